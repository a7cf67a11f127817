#include "backend/start/start_models.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "backend/start/start.h"
#include "tests/support/synthetic_tracks.h"

namespace cohort {
namespace {

using test::CameraPath;
using test::SyntheticTracks;

SyntheticTracks Scene(CameraPath path, double relief, double focal_px = 500.0) {
  test::SyntheticTracksOptions options;
  options.path = path;
  options.frames = 16;
  options.points = 200;
  options.noise_px = 0.2;
  options.plane_relief = relief;
  options.camera.fx = options.camera.fy = focal_px;
  return MakeSyntheticTracks(options);
}

std::vector<StartModel> Starts(const SyntheticTracks& scene, const WhitenedTracks& whitened) {
  const FramePairMotion pair =
      MeasureMotion(whitened, *scene.file.camera, 0, whitened.frame_count() - 1);
  return BuildStartModels(whitened, *scene.file.camera, pair);
}

// ATE over the window, relative to the length of its path.
double RelativeError(const StartModel& start, const SyntheticTracks& scene) {
  std::map<FrameIndex, Rigid3> poses;
  for (const int f : start.model.RegisteredFrames()) {
    poses[start.model.whitened().frames()[f].index] = start.model.Pose(f);
  }
  double path = 0.0;
  const Eigen::Vector3d first = scene.cam_from_world.begin()->second.Inverse().translation;
  for (const auto& [frame, pose] : scene.cam_from_world) {
    path = std::max(path, (pose.Inverse().translation - first).norm());
  }
  return test::AbsoluteTrajectoryError(poses, scene.cam_from_world) / path;
}

// The start of a method that is nearest to the truth; none: the method gave no start.
std::optional<double> BestError(const std::vector<StartModel>& starts,
                                const SyntheticTracks& scene,
                                StartMethod method) {
  std::optional<double> best;
  for (const StartModel& start : starts) {
    if (start.method != method) continue;
    const double error = RelativeError(start, scene);
    if (!best || error < *best) best = error;
  }
  return best;
}

TEST(StartModels, TheEssentialMatrixStartsASceneWithDepth) {
  const SyntheticTracks scene = Scene(CameraPath::kLateral, 1.0);
  const WhitenedTracks whitened(scene.file, {});
  const auto error = BestError(Starts(scene, whitened), scene, StartMethod::kEssential);
  ASSERT_TRUE(error);
  EXPECT_LT(*error, 0.01);
}

TEST(StartModels, AHomographyStartsAPlaneAndNoSceneWithDepth) {
  const SyntheticTracks plane = Scene(CameraPath::kArc, 0.0);
  const WhitenedTracks whitened(plane.file, {});
  const auto error = BestError(Starts(plane, whitened), plane, StartMethod::kHomography);
  ASSERT_TRUE(error);
  EXPECT_LT(*error, 0.05);

  const SyntheticTracks deep = Scene(CameraPath::kLateral, 1.0);
  const WhitenedTracks deep_whitened(deep.file, {});
  EXPECT_FALSE(BestError(Starts(deep, deep_whitened), deep, StartMethod::kHomography));
}

TEST(StartModels, TheAffineFactorisationStartsAnObjectSeenFromAllSides) {
  const SyntheticTracks scene = Scene(CameraPath::kArc, 1.0);
  const WhitenedTracks whitened(scene.file, {});
  const auto error = BestError(Starts(scene, whitened), scene, StartMethod::kAffine);
  ASSERT_TRUE(error);
  EXPECT_LT(*error, 0.01);
}

TEST(StartModels, TheBestIsFirstAndCostsAreOfTheSameObservations) {
  const SyntheticTracks scene = Scene(CameraPath::kArc, 1.0);
  const WhitenedTracks whitened(scene.file, {});
  const auto starts = Starts(scene, whitened);
  ASSERT_FALSE(starts.empty());
  EXPECT_TRUE(std::is_sorted(
      starts.begin(), starts.end(), [](const auto& a, const auto& b) { return a.cost < b.cost; }));
  EXPECT_LT(RelativeError(starts.front(), scene), 0.01);
  for (const StartModel& start : starts) EXPECT_EQ(start.window, starts.front().window);
}

TEST(FindStart, ATurningCameraGivesNoStartInAnyWindow) {
  const SyntheticTracks scene = Scene(CameraPath::kRotation, 1.0);
  const WhitenedTracks whitened(scene.file, {});
  std::vector<FramePairMotion> pairs;
  for (int b = 8; b < 16; ++b) pairs.push_back(MeasureMotion(whitened, *scene.file.camera, 0, b));
  const Start start = FindStart(whitened, *scene.file.camera, pairs);
  EXPECT_FALSE(start.model);
  EXPECT_GE(start.windows_tried, 1u);
  EXPECT_LT(start.windows_tried, pairs.size()) << "windows much like one that failed";
}

}  // namespace
}  // namespace cohort
