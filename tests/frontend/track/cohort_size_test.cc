// From the fewest features that the tracker is made for to the most.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <vector>

#include "frontend/core/part_times.h"
#include "frontend/core/statistics.h"
#include "frontend/detect/corners.h"
#include "frontend/track/tracker.h"
#include "tests/support/plane_scene.h"

namespace cohort {
namespace {

// Corners of the first frame that show one point of the scene, seen until the last: the nearest and
// the farthest ones.
std::vector<Eigen::Vector3d> LastingPoints(const test::PlaneScene& scene,
                                           const cv::Mat& first,
                                           int frames,
                                           std::ptrdiff_t near,
                                           std::ptrdiff_t far) {
  const auto seen_whole = [&](int frame, const Eigen::Vector3d& point) {
    constexpr double kMarginPx = 12.0;
    const Rigid3 cam_from_world = test::PlaneScene::CamFromWorld(frame);
    if (!scene.IsVisible(cam_from_world, point)) return false;
    const Eigen::Vector2d xy = *scene.camera().Project(cam_from_world * point);
    return std::ranges::all_of(std::vector{-kMarginPx, kMarginPx}, [&](double d) {
      const Eigen::Vector2d side = xy + Eigen::Vector2d(d, 0);
      const auto shown = scene.PointAt(cam_from_world, side);
      return scene.camera().Contains(xy + Eigen::Vector2d(d, d)) && shown &&
             std::abs(shown->z() - point.z()) < 0.01;
    });
  };
  std::vector<Eigen::Vector3d> points;
  for (const Eigen::Vector2d& xy : DetectCorners(first, {}, {}, 16, 200, {})) {
    const auto point = scene.PointAt(test::PlaneScene::CamFromWorld(0), xy);
    bool lasts = point.has_value();
    for (int t = 0; t < frames && lasts; ++t) lasts = seen_whole(t, *point);
    if (lasts) points.push_back(*point);
  }
  std::ranges::stable_sort(points, {}, [](const Eigen::Vector3d& p) { return p.z(); });
  if (std::ssize(points) > near + far) points.erase(points.begin() + near, points.end() - far);
  return points;
}

// The surroundings of a single near feature say nothing of its depth: only its own trajectory does.
TEST(CohortSize, EightFeaturesAreFollowedAsOne) {
  constexpr int kFrames = 25;
  const test::PlaneScene scene;
  const auto picture = [&](int t) {
    return BuildPyramid(scene.Render(test::PlaneScene::CamFromWorld(t)));
  };
  const Pyramid first = picture(0);
  for (const std::ptrdiff_t near : {1, 4}) {
    const auto points = LastingPoints(scene, first.levels.front(), kFrames, near, 8 - near);
    ASSERT_EQ(points.size(), 8u);
    const auto truth = [&](int t, std::size_t f) {
      return *scene.camera().Project(test::PlaneScene::CamFromWorld(t) * points[f]);
    };
    std::vector<Eigen::Vector2d> born;
    for (std::size_t f = 0; f < points.size(); ++f) born.push_back(truth(0, f));
    for (const auto& [name, constraint] : kConstraintNames) {
      SCOPED_TRACE(testing::Message() << name << ", " << near << " of them near");
      TrackerOptions options;
      options.subspace.constraint = constraint;
      const auto mover = MakeMover(options);
      mover->Add(born, first);
      std::vector<double> errors;
      for (int t = 1; t < kFrames; ++t) {
        const std::vector<Move> moves = mover->MoveFeatures(picture(t));
        for (std::size_t f = 0; f < moves.size(); ++f) {
          ASSERT_FALSE(moves[f].loss) << "feature " << f << " in frame " << t;
          EXPECT_EQ(moves[f].state, ObservationState::kObserved)
              << "feature " << f << " in frame " << t;
          errors.push_back((moves[f].xy - truth(t, f)).norm());
        }
      }
      EXPECT_LT(Median(errors), 0.1);
      EXPECT_LT(Quantile(errors, 1.0), 0.5);
    }
  }
}

// A textured plane that turns and comes nearer.
class TexturedPlane {
 public:
  static constexpr int kWidth = 1280;
  static constexpr int kHeight = 960;

  static Eigen::Vector2d Position(int t, const Eigen::Vector2d& first_xy) {
    return Turned(t) * (first_xy - Centre()) + Centre() + Shift(t);
  }
  static cv::Mat Picture(int t) {
    const Eigen::Matrix2d back = Turned(t).inverse();
    return test::ImageOf(
        [&](double x, double y) {
          const Eigen::Vector2d first =
              back * (Eigen::Vector2d(x, y) - Centre() - Shift(t)) + Centre();
          return test::NoiseAt(first.x() + 3000, first.y() + 3000);
        },
        kWidth,
        kHeight,
        CV_8U);
  }

 private:
  static Eigen::Vector2d Centre() { return {0.5 * (kWidth - 1), 0.5 * (kHeight - 1)}; }
  static Eigen::Vector2d Shift(int t) { return {1.7 * t, -0.9 * t}; }
  static Eigen::Matrix2d Turned(int t) {
    return (1.0 + 0.004 * t) * Eigen::Rotation2Dd(0.003 * t).toRotationMatrix();
  }
};

struct CrowdRun {
  std::size_t born = 0;
  std::size_t observed = 0;  // in the last frame
  std::vector<double> errors;
  double ms = 0.0;  // of all frames but the first
};

CrowdRun FollowCrowd(int features, const std::vector<cv::Mat>& film) {
  TrackerOptions options;
  options.detector.max_features = features;
  options.detector.min_distance_px = 8.0;
  options.detector.redetect_below = 0.0;
  const auto tracker = MakeTracker(options);
  std::vector<Eigen::Vector2d> first;
  CrowdRun run;
  for (std::size_t i = 0; i < film.size(); ++i) {
    Frame frame;
    frame.index = FrameIndex{static_cast<std::uint32_t>(i)};
    frame.gray = film[i];
    const double start_ms = ThreadCpuMs();
    const FrameResult result = tracker->Track(frame);
    if (i > 0) run.ms += ThreadCpuMs() - start_ms;
    if (i == 0) {
      for (const Observation& o : result.observations) first.push_back(o.xy);
      run.born = first.size();
      continue;
    }
    run.observed = 0;
    for (const Observation& o : result.observations) {
      if (o.state != ObservationState::kObserved) continue;
      ++run.observed;
      run.errors.push_back(
          (o.xy -
           TexturedPlane::Position(static_cast<int>(i), first[static_cast<std::size_t>(o.feature)]))
              .norm());
    }
  }
  return run;
}

TEST(CohortSize, FourThousandFeaturesAreFollowedLikeOneThousand) {
  constexpr int kFrames = 6;
  std::vector<cv::Mat> film;
  for (int t = 0; t < kFrames; ++t) film.push_back(TexturedPlane::Picture(t));
  const CrowdRun many = FollowCrowd(4000, film);
  const CrowdRun fewer = FollowCrowd(1000, film);
  // Printed, not asserted: quadratic growth would be 16.
  std::printf("4000 features: %.0f ms a frame, %.1f times that of 1000\n",
              many.ms / (kFrames - 1),
              many.ms / fewer.ms);
  for (const CrowdRun* run : {&many, &fewer}) {
    SCOPED_TRACE(run->born);
    std::printf("%zu features: %zu observed at the end, %.3f px median, %.3f px of 99 %%\n",
                run->born,
                run->observed,
                Median(run->errors),
                Quantile(run->errors, 0.99));
    EXPECT_GT(run->observed, run->born * 95 / 100);  // some leave the picture
    EXPECT_LT(Median(run->errors), 0.05);
    EXPECT_LT(Quantile(run->errors, 0.99), 0.3);
  }
  EXPECT_EQ(many.born, 4000u);
  EXPECT_EQ(fewer.born, 1000u);
}

}  // namespace
}  // namespace cohort
