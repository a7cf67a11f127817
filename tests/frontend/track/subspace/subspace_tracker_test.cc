#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <opencv2/imgproc.hpp>

#include "frontend/core/statistics.h"
#include "frontend/detect/corners.h"
#include "frontend/energy/total_energy.h"
#include "frontend/image/sampling.h"
#include "frontend/track/subspace/optimizer.h"
#include "frontend/track/tracker.h"
#include "tests/support/numeric_gradient.h"
#include "tests/support/plane_scene.h"

namespace cohort {
namespace {

Frame FrameOf(int index, const cv::Mat& image) {
  Frame frame;
  frame.index = FrameIndex{static_cast<std::uint32_t>(index)};
  image.convertTo(frame.gray, CV_8U, 255.0);
  return frame;
}

// The paper's kind of degradation, at the level medium.
cv::Mat Darken(const cv::Mat& image, int index) {
  RandomStream random = RandomStream(5, "test/noise").Fork(static_cast<std::uint64_t>(index));
  cv::Mat dark = 0.3 * image;
  for (auto& v : cv::Mat_<float>(dark)) v += static_cast<float>(0.04 * random.Gaussian());
  cv::GaussianBlur(dark, dark, cv::Size(0, 0), 2.0);
  for (auto& v : cv::Mat_<float>(dark)) v += static_cast<float>(0.02 * random.Gaussian());
  return dark;
}

// Where there are no errors, no bound is kept.
double ErrorQuantile(std::vector<double> errors, double share) {
  return errors.empty() ? 1e9 : Quantile(std::move(errors), share);
}

// The point that a feature shows; none on a depth edge, where corners are no points of the scene.
std::optional<Eigen::Vector3d> TruePoint(const test::PlaneScene& scene,
                                         const Rigid3& cam_from_world,
                                         const Eigen::Vector2d& xy) {
  auto point = scene.PointAt(cam_from_world, xy);
  const auto left = scene.PointAt(cam_from_world, xy - Eigen::Vector2d(12, 0));
  const auto right = scene.PointAt(cam_from_world, xy + Eigen::Vector2d(12, 0));
  if (!point || !left || !right || std::abs(left->z() - right->z()) > 0.01) return std::nullopt;
  return point;
}

// Errors [px] of a tracker on the rendered screens, against the truth of each track's first
// position. Corners on depth edges are no points of the scene: they are left out.
struct Errors {
  std::vector<double> observed;
  std::vector<double> predicted;
  std::map<int, std::vector<double>> observed_by_age;
  int kept_after_20 = 0;
};

Errors TrackScene(const TrackerOptions& options, int frames, bool dark) {
  const test::PlaneScene scene;
  // Rendering takes longer than tracking: each picture once for all trackers of a test.
  static std::map<std::pair<int, bool>, cv::Mat> pictures;
  const auto tracker = MakeTracker(options);
  struct Truth {
    Eigen::Vector3d point;
    int born;
  };
  std::map<FeatureId, std::optional<Truth>> truth;
  Errors errors;
  for (int t = 0; t < frames; ++t) {
    const Rigid3 cam_from_world = test::PlaneScene::CamFromWorld(t);
    cv::Mat& picture = pictures[{t, dark}];
    if (picture.empty()) {
      picture = scene.Render(cam_from_world);
      if (dark) picture = Darken(picture, t);
    }
    const FrameResult result = tracker->Track(FrameOf(t, picture));
    for (const Observation& o : result.observations) {
      const auto [it, born] = truth.try_emplace(o.feature);
      if (born) {
        if (const auto point = TruePoint(scene, cam_from_world, o.xy)) {
          it->second = Truth{*point, t};
        }
        continue;
      }
      if (!it->second || !scene.IsVisible(cam_from_world, it->second->point)) continue;
      const double error =
          (*scene.camera().Project(cam_from_world * it->second->point) - o.xy).norm();
      if (o.state == ObservationState::kObserved) {
        errors.observed.push_back(error);
        errors.observed_by_age[t - it->second->born].push_back(error);
        if (it->second->born == 0 && t == 20) ++errors.kept_after_20;
      } else {
        errors.predicted.push_back(error);
      }
    }
  }
  return errors;
}

TrackerOptions OptionsOf(TrackerKind kind) {
  TrackerOptions options;
  options.tracker = kind;
  options.detector.max_features = 80;
  return options;
}

TEST(SubspaceTracker, FollowsACleanSceneToAFractionOfAPixel) {
  const Errors errors = TrackScene(OptionsOf(TrackerKind::kSubspace), 25, false);
  EXPECT_LT(ErrorQuantile(errors.observed, 0.5), 0.15);
  EXPECT_GT(errors.kept_after_20, 25);
}

TEST(SubspaceTracker, BeatsKltInTheDark) {
  const Errors ours = TrackScene(OptionsOf(TrackerKind::kSubspace), 25, true);
  const Errors klt = TrackScene(OptionsOf(TrackerKind::kKlt), 25, true);
  EXPECT_LT(ErrorQuantile(ours.observed, 0.5), ErrorQuantile(klt.observed, 0.5));
  EXPECT_LT(ErrorQuantile(ours.observed, 0.9), ErrorQuantile(klt.observed, 0.9));
  EXPECT_GT(ours.kept_after_20, klt.kept_after_20);
}

TEST(SubspaceTracker, EveryPenaltyModeAndOptimizerTracksInTheDark) {
  const Errors klt = TrackScene(OptionsOf(TrackerKind::kKlt), 10, true);
  for (const auto& [penalty_name, penalty] : kPenaltyNames) {
    for (const auto& [constraint_name, constraint] : kConstraintNames) {
      for (const auto& [optimizer_name, optimizer] : kOptimizerNames) {
        TrackerOptions options = OptionsOf(TrackerKind::kSubspace);
        options.subspace.penalty = penalty;
        options.subspace.constraint = constraint;
        options.subspace.optimizer = optimizer;
        const Errors errors = TrackScene(options, 10, true);
        EXPECT_LT(ErrorQuantile(errors.observed, 0.5), ErrorQuantile(klt.observed, 0.5))
            << penalty_name << ", " << constraint_name << ", " << optimizer_name;
      }
    }
  }
}

TEST(DescentTracker, FollowsACleanScene) {
  const Errors errors = TrackScene(OptionsOf(TrackerKind::kDescent), 15, false);
  EXPECT_LT(ErrorQuantile(errors.observed, 0.5), 0.2);
}

TEST(JointAndSingleTrackers, GoOnWithTheRestWhenFeaturesEnd) {
  const test::PlaneScene scene;
  const auto picture = [&](int t) {
    return BuildPyramid(scene.Render(test::PlaneScene::CamFromWorld(t)));
  };
  TrackerOptions guide_alone = OptionsOf(TrackerKind::kSubspace);
  guide_alone.measurement.enabled = false;
  for (const TrackerOptions& options :
       {OptionsOf(TrackerKind::kDescent), OptionsOf(TrackerKind::kSubspace), guide_alone}) {
    const auto mover = MakeMover(options);
    const Pyramid first = picture(0);
    const auto corners = DetectCorners(first.levels.front(), {}, {}, 60, 40, options.detector);
    ASSERT_GE(corners.size(), 20u);
    mover->Add(corners, first);
    std::vector<std::uint8_t> keep;
    std::vector<Eigen::Vector3d> points;
    for (std::size_t f = 0; f < corners.size(); ++f) {
      const auto point = TruePoint(scene, test::PlaneScene::CamFromWorld(0), corners[f]);
      keep.push_back(point && f % 2 == 1);
      if (keep.back()) points.push_back(*point);
    }
    mover->MoveFeatures(picture(1));
    mover->Keep(keep);
    for (int t = 2; t < 6; ++t) {
      const std::vector<Move> moves = mover->MoveFeatures(picture(t));
      ASSERT_EQ(moves.size(), points.size());
      std::vector<double> errors;
      for (std::size_t f = 0; f < moves.size(); ++f) {
        const Rigid3 pose = test::PlaneScene::CamFromWorld(t);
        errors.push_back((*scene.camera().Project(pose * points[f]) - moves[f].xy).norm());
      }
      EXPECT_LT(ErrorQuantile(errors, 0.5), 0.3) << NameOf(kTrackerNames, options.tracker);
    }
  }
}

// A bar crosses the scene: what it hides must be held where it is, and be found again behind it.
TEST(SubspaceTracker, HoldsWhatABarHidesAndFindsItAgain) {
  const test::PlaneScene scene;
  TrackerOptions options = OptionsOf(TrackerKind::kSubspace);
  options.detector.redetect_below = 0.0;
  const auto tracker = MakeTracker(options);
  std::map<FeatureId, Eigen::Vector3d> points;
  std::vector<double> hidden;
  std::vector<double> after;
  int hidden_but_observed = 0;
  for (int t = 0; t < 32; ++t) {
    const Rigid3 cam_from_world = test::PlaneScene::CamFromWorld(t);
    cv::Mat image = scene.Render(cam_from_world);
    const int left = -60 + 16 * (t - 10);  // enters after ten frames, 16 px a frame, 40 px wide
    const cv::Rect bar = cv::Rect(left, 0, 40, 240) & cv::Rect(0, 0, 320, 240);
    if (!bar.empty()) {
      for (int y = bar.y; y < bar.y + bar.height; ++y) {
        for (int x = bar.x; x < bar.x + bar.width; ++x) {
          image.at<float>(y, x) = static_cast<float>(test::NoiseAt(x - left + 5000, y));
        }
      }
    }
    const FrameResult result = tracker->Track(FrameOf(t, image));
    for (const Observation& o : result.observations) {
      if (t == 0) {
        if (const auto point = TruePoint(scene, cam_from_world, o.xy)) points[o.feature] = *point;
        continue;
      }
      if (!points.contains(o.feature)) continue;
      const Eigen::Vector3d& point = points.at(o.feature);
      if (!scene.IsVisible(cam_from_world, point)) continue;
      const Eigen::Vector2d truth = *scene.camera().Project(cam_from_world * point);
      const bool under_bar =
          truth.x() > bar.x + 2 && truth.x() < bar.x + bar.width - 2 && !bar.empty();
      if (under_bar) {
        hidden.push_back((truth - o.xy).norm());
        hidden_but_observed += o.state == ObservationState::kObserved ? 1 : 0;
      } else if (t == 31) {
        after.push_back((truth - o.xy).norm());
      }
    }
  }
  ASSERT_GT(hidden.size(), 50u);
  EXPECT_LT(ErrorQuantile(hidden, 0.5), 1.0);
  EXPECT_LT(hidden_but_observed, static_cast<int>(hidden.size() / 10));
  ASSERT_GT(after.size(), 20u);
  EXPECT_LT(ErrorQuantile(after, 0.5), 0.2);
}

// Features born when the window is full, against those that were there from the start, at the same
// age.
TEST(SubspaceTracker, ANewFeatureTracksAsWellAsAnOldOneAfterFewFrames) {
  const test::PlaneScene scene;
  // The first cohort sees the right half only; in frame 12 the left half is unveiled and fills up.
  TrackerOptions options = OptionsOf(TrackerKind::kSubspace);
  options.detector.max_features = 160;
  options.detector.min_distance_px = 20.0;
  options.detector.redetect_below = 1.0;
  const auto tracker = MakeTracker(options);
  std::map<FeatureId, std::pair<Eigen::Vector3d, int>> points;
  std::vector<double> old_errors;
  std::vector<double> new_errors;
  for (int t = 0; t < 22; ++t) {
    const Rigid3 cam_from_world = test::PlaneScene::CamFromWorld(t);
    cv::Mat image = Darken(scene.Render(cam_from_world), t);
    if (t < 12) image(cv::Rect(0, 0, 140, 240)) = 0.15;
    const FrameResult result = tracker->Track(FrameOf(t, image));
    for (const Observation& o : result.observations) {
      const auto point = TruePoint(scene, cam_from_world, o.xy);
      const auto [it, born] =
          points.try_emplace(o.feature, point.value_or(Eigen::Vector3d(0, 0, 1e9)), t);
      const auto& [in_world, birth] = it->second;
      const int age = t - birth;
      if (age < 4 || age > 9 || !scene.IsVisible(cam_from_world, in_world)) continue;
      const double error = (*scene.camera().Project(cam_from_world * in_world) - o.xy).norm();
      if (birth == 0) old_errors.push_back(error);
      if (birth == 12) new_errors.push_back(error);
    }
  }
  ASSERT_GT(old_errors.size(), 100u);
  ASSERT_GT(new_errors.size(), 50u);
  EXPECT_LT(ErrorQuantile(new_errors, 0.5), 1.2 * ErrorQuantile(old_errors, 0.5));
  EXPECT_LT(ErrorQuantile(new_errors, 0.9), 1.2 * ErrorQuantile(old_errors, 0.9));
}

TEST(Optimizers, JointNewtonReachesNoHigherEnergyThanAlgorithm1) {
  const test::PlaneScene scene;
  const int n = 11;
  const int F = 40;
  const int L = 8;
  RandomStream random(9, "test/features");
  const Rigid3 first = test::PlaneScene::CamFromWorld(0);
  const cv::Mat reference = Darken(scene.Render(first), 0);
  const cv::Mat current = Darken(scene.Render(test::PlaneScene::CamFromWorld(L)), L);
  std::vector<std::vector<float>> patches(F, std::vector<float>(n * n));
  std::vector<const float*> pointers;
  Eigen::MatrixXd history(2 * L, F);
  for (int f = 0; f < F; ++f) {
    const Eigen::Vector2d xy(random.Uniform(60, 260), random.Uniform(30, 210));
    const Eigen::Vector3d point = *scene.PointAt(first, xy);
    SamplePatch(reference, xy.x(), xy.y(), n, patches[f].data());
    pointers.push_back(patches[f].data());
    for (int l = 1; l <= L; ++l) {
      const Eigen::Vector2d past =
          *scene.camera().Project(test::PlaneScene::CamFromWorld(L - l) * point);
      history.block<2, 1>(2 * (l - 1), f) =
          past + 0.3 * Eigen::Vector2d(random.Gaussian(), random.Gaussian());
    }
  }
  const TrajectoryMatrix trajectories(history, true);
  Penalty penalty;
  penalty.smoothing = F * 0.02;
  const Eigen::Matrix2Xd start = history.topRows(2);
  for (const double weight : {1.0, 5.0, 25.0}) {
    const TotalEnergy energy(
        current, pointers, n, Eigen::VectorXd::Constant(F, weight), &trajectories, &penalty);
    const OptimizerResult descent = MinimizeAlgorithm1(energy, start, 4, 40);
    const OptimizerResult newton = MinimizeJointly(energy, start, 3, 40);
    EXPECT_LT(descent.energy, energy.Value(start));
    EXPECT_LE(newton.energy, descent.energy * 1.002) << "weight " << weight;
    EXPECT_LT(newton.evaluations, descent.evaluations);
  }
}

TEST(TotalEnergy, GradientMatchesCentralDifferences) {
  const cv::Mat picture = test::WavesImage(120, 90, 0, 0, CV_32F);
  const int n = 7;
  RandomStream random(2, "test/energy");
  const int F = 12;
  std::vector<std::vector<float>> patches(F, std::vector<float>(n * n));
  std::vector<const float*> pointers;
  Eigen::MatrixXd history(6, F);
  Eigen::Matrix2Xd x(2, F);
  for (int f = 0; f < F; ++f) {
    const Eigen::Vector2d xy(random.Uniform(20, 100), random.Uniform(20, 70));
    SamplePatch(picture, xy.x(), xy.y(), n, patches[f].data());
    pointers.push_back(patches[f].data());
    x.col(f) = xy + Eigen::Vector2d(random.Uniform(1, 3), random.Uniform(-3, -1));
    for (int r = 0; r < 6; ++r) history(r, f) = xy[r % 2] - r + 0.4 * random.Gaussian();
  }
  const TrajectoryMatrix trajectories(history, true);
  Penalty penalty;
  penalty.smoothing = 0.2;
  const TotalEnergy energy(
      picture, pointers, n, Eigen::VectorXd::Constant(F, 0.5), &trajectories, &penalty);
  const Eigen::Matrix2Xd exact = energy.Gradient(x);
  const Eigen::Matrix2Xd numeric =
      test::NumericGradient([&](const Eigen::Matrix2Xd& y) { return energy.Value(y); }, x, 2e-3);
  EXPECT_LT((exact - numeric).norm(), 0.03 * numeric.norm());
  const TotalEnergy::Line line = energy.Along(x, exact);
  EXPECT_NEAR(line(-2.0), energy.Value(x - 2.0 * exact), 1e-9);
}

}  // namespace
}  // namespace cohort
