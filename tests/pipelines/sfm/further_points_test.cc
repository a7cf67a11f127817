#include "pipelines/sfm/further_points.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "backend/scene/row_poses.h"
#include "frontend/core/random_stream.h"
#include "frontend/core/statistics.h"
#include "tests/support/plane_scene.h"

namespace cohort {
namespace {

constexpr int kFrames = 24;
constexpr std::size_t kWanted = 3000;
constexpr double kNoisePx = 0.2;  // of the tracks

// PlaneScene's screens and wall before a camera of any lens and readout, with its true poses, and a
// few known points.
class Screens {
 public:
  explicit Screens(const Camera& camera, double readout = 0.0) {
    model_.camera = camera;
    model_.readout = readout;
    for (int i = 0; i < kFrames; ++i) {
      const auto frame = FrameIndex(i);
      frames_.push_back(frame);
      model_.cam_from_world[frame] = test::PlaneScene::CamFromWorld(i);
      file_.frames.push_back({frame, "", 0});
    }
    file_.width_px = camera.width_px;
    file_.height_px = camera.height_px;
    std::vector<Observation> observations;
    for (const int from : {0, kFrames - 1}) {
      for (int y = 20; y < camera.height_px - 10; y += 40) {
        for (int x = 20; x < camera.width_px - 10; x += 40) Know(FrameIndex(from), {x, y});
      }
    }
    for (const auto& [feature, point] : model_.points) {
      for (const PointView& view : point.views)
        observations.push_back({feature, view.frame, view.xy});
    }
    file_.tracks = TrackSet::Build(std::move(observations));
  }

  const Reconstruction& model() const { return model_; }

  // The pixel's ray, as PlaneScene's own pinhole sees it.
  Eigen::Vector2d InPinhole(const Eigen::Vector2d& xy) const {
    return *scene_.camera().Project(model_.camera.Unproject(xy).homogeneous().eval());
  }
  std::optional<Eigen::Vector3d> PointAt(FrameIndex frame, const Eigen::Vector2d& xy) const {
    return scene_.PointAt(Rows().CamFromWorld(frame, xy), InPinhole(xy));
  }
  cv::Mat Picture(FrameIndex frame) const {
    const RowPoses rows = Rows();
    cv::Mat picture(model_.camera.height_px, model_.camera.width_px, CV_8UC1);
    for (int y = 0; y < picture.rows; ++y) {
      const Rigid3 cam_from_world = rows.CamFromWorld(frame, {0.0, static_cast<double>(y)});
      for (int x = 0; x < picture.cols; ++x) {
        const Eigen::Vector2d xy(x, y);
        picture.at<std::uint8_t>(y, x) =
            cv::saturate_cast<std::uint8_t>(255.0 * scene_.ValueAt(cam_from_world, InPinhole(xy)));
      }
    }
    return picture;
  }

  using Change = std::function<void(int, Frame&)>;
  std::map<FeatureId, FurtherPoint> Points(const Change& change = {},
                                           std::size_t wanted = kWanted) const {
    FurtherPoints further(file_, model_, frames_, wanted);
    for (int i = 0; i < kFrames; ++i) {
      Frame frame;
      frame.index = FrameIndex(i);
      frame.gray = Picture(frame.index);
      if (change) change(i, frame);
      cv::Mat bgr;
      cv::cvtColor(frame.gray, bgr, cv::COLOR_GRAY2BGR);
      further.Follow(frame, bgr);
    }
    return further.Finish();
  }

  // Distances from the surface in the points' first views; at the edge of a screen, from the nearer
  // of the two surfaces that the patch shows.
  std::vector<double> ErrorsOf(const std::map<FeatureId, FurtherPoint>& points) const {
    const RowPoses rows = Rows();
    std::vector<double> errors;
    for (const auto& [feature, further] : points) {
      const PointView& first = further.point.views.front();
      double error = 1e9;
      for (const double aside_px : {-7.0, 0.0, 7.0}) {
        const Eigen::Vector2d xy = first.xy + Eigen::Vector2d(aside_px, 0.0);
        const auto at = PointAt(first.frame, xy);
        if (!at) continue;
        // Along the ray of the first view to the depth of that surface.
        const Rigid3 cam_from_world = rows.CamFromWorld(first.frame, first.xy);
        const double depth = (cam_from_world * *at).z();
        const Eigen::Vector3d on_ray =
            cam_from_world.Inverse() *
            (depth * model_.camera.Unproject(first.xy).homogeneous()).eval();
        error = std::min(error, (further.point.in_world - on_ray).norm());
      }
      errors.push_back(error);
    }
    return errors;
  }

 private:
  RowPoses Rows() const { return {model_.cam_from_world, model_.readout, model_.camera}; }

  void Know(FrameIndex from, const Eigen::Vector2d& xy) {
    const auto in_world = PointAt(from, xy);
    if (!in_world) return;
    Point3D point;
    point.in_world = *in_world;
    const RowPoses rows = Rows();
    for (const FrameIndex frame : frames_) {
      const auto seen = rows.Project(model_.camera, frame, *in_world);
      if (!seen || !model_.camera.Contains(*seen)) continue;
      const auto at = PointAt(frame, *seen);
      if (!at || (*at - *in_world).norm() >= 0.02) continue;
      const Eigen::Vector2d noise(noise_.Gaussian(), noise_.Gaussian());
      point.views.push_back({frame, *seen + kNoisePx * noise});
    }
    if (point.views.size() < 2) return;
    model_.points[FeatureId(static_cast<std::uint32_t>(model_.points.size()))] = point;
  }

  test::PlaneScene scene_;
  RandomStream noise_{3, "test/further_points"};
  std::vector<FrameIndex> frames_;
  Reconstruction model_;
  TrackFile file_;
};

Camera Pinhole() { return test::PlaneScene().camera(); }

Camera Fisheye() {
  Camera camera = Pinhole();
  camera.model = CameraModel::kFisheye;
  camera.k1 = -0.05;
  return camera;
}

class FurtherPointsOf : public testing::TestWithParam<std::pair<Camera, double>> {};

TEST_P(FurtherPointsOf, LieOnTheSurfaces) {
  const Screens screens(GetParam().first, GetParam().second);
  const auto points = screens.Points();
  EXPECT_GT(points.size(), 5 * screens.model().points.size());
  const std::vector<double> errors = screens.ErrorsOf(points);
  EXPECT_LT(Median(errors), 0.02) << "of distances of 2.6 to 7";
  EXPECT_LT(Quantile(errors, 0.75), 0.1);
  for (const auto& [feature, further] : points) {
    ASSERT_FALSE(screens.model().points.contains(feature)) << "the id of a track";
    ASSERT_GE(further.point.views.size(), 5U);
  }
}

constexpr const char* kCameras[] = {"Pinhole", "Fisheye", "RollingShutter"};
INSTANTIATE_TEST_SUITE_P(EveryCamera,
                         FurtherPointsOf,
                         testing::Values(std::pair(Pinhole(), 0.0),
                                         std::pair(Fisheye(), 0.0),
                                         std::pair(Pinhole(), 0.8)),
                         [](const auto& camera) { return kCameras[camera.index]; });

// A printed card sways in front of the scene.
cv::Rect CardIn(int i) {
  return {120 + static_cast<int>(std::lround(25.0 * std::sin(0.6 * i))),
          90 + static_cast<int>(std::lround(20.0 * std::sin(0.45 * i + 1.0))),
          70,
          60};
}

TEST(FurtherPoints, NothingThatMovesAddsPoints) {
  const Screens screens(Pinhole());
  cv::Mat card(60, 70, CV_8UC1);
  for (int y = 0; y < card.rows; ++y) {
    for (int x = 0; x < card.cols; ++x) {
      card.at<std::uint8_t>(y, x) =
          cv::saturate_cast<std::uint8_t>(255.0 * test::NoiseAt(500.0 + x, 700.0 + y));
    }
  }
  const auto points =
      screens.Points([&](int i, Frame& frame) { card.copyTo(frame.gray(CardIn(i))); });
  EXPECT_GT(points.size(), 3 * screens.model().points.size());
  int on_card = 0;
  for (const auto& [feature, further] : points) {
    for (const PointView& view : further.point.views) {
      const cv::Rect card_now = CardIn(static_cast<int>(ToInt(view.frame)));
      constexpr int kRim = 3;  // a window at the edge sees mostly the scene
      const cv::Rect inside(card_now.x + kRim,
                            card_now.y + kRim,
                            card_now.width - 2 * kRim,
                            card_now.height - 2 * kRim);
      if (inside.contains(cv::Point(cvRound(view.xy.x()), cvRound(view.xy.y())))) ++on_card;
    }
  }
  EXPECT_EQ(on_card, 0) << "views on the card";
}

TEST(FurtherPoints, NoneIsSeenInTheMask) {
  const Screens screens(Pinhole());
  const auto points = screens.Points([](int, Frame& frame) {
    frame.mask = cv::Mat(frame.gray.size(), CV_8UC1, cv::Scalar(255));
    frame.mask.colRange(0, 150).setTo(0);
  });
  EXPECT_GT(points.size(), screens.model().points.size());
  for (const auto& [feature, further] : points) {
    for (const PointView& view : further.point.views) ASSERT_GE(std::lround(view.xy.x()), 150);
  }
}

TEST(FurtherPoints, AreTheSameForAnyNumberOfThreads) {
  const Screens screens(Pinhole());
  const int threads = cv::getNumThreads();
  cv::setNumThreads(1);
  const auto of_one = screens.Points();
  cv::setNumThreads(4);
  const auto of_four = screens.Points();
  cv::setNumThreads(threads);
  ASSERT_FALSE(of_one.empty());
  ASSERT_EQ(of_one.size(), of_four.size());
  for (const auto& [feature, further] : of_one) {
    const FurtherPoint& other = of_four.at(feature);
    ASSERT_EQ(further.point.in_world, other.point.in_world);
    ASSERT_EQ(further.bgr, other.bgr);
    ASSERT_EQ(further.point.views.size(), other.point.views.size());
  }
}

TEST(FurtherPoints, HaveTheMeanGreyOfTheirPixels) {
  const Screens screens(Pinhole());
  const auto points = screens.Points();
  ASSERT_FALSE(points.empty());
  const FurtherPoint& first = points.begin()->second;
  double sum = 0.0;
  for (const PointView& view : first.point.views) {
    sum += screens.Picture(view.frame).at<std::uint8_t>(cvRound(view.xy.y()), cvRound(view.xy.x()));
  }
  EXPECT_NEAR(first.bgr[1], sum / static_cast<double>(first.point.views.size()), 1e-9);
}

TEST(FurtherPoints, AreNoMoreThanWanted) {
  const Screens screens(Pinhole());
  const std::size_t wanted = 100;
  const auto points = screens.Points({}, wanted);
  EXPECT_GT(points.size(), wanted / 2);
  EXPECT_LE(points.size(), wanted);
}

}  // namespace
}  // namespace cohort
