#include "backend/scene/focal_scale.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "backend/adjust/rolling_shutter.h"
#include "backend/scene/reconstruction.h"
#include "backend/scene/row_poses.h"
#include "tests/support/cameras.h"
#include "tests/support/synthetic_tracks.h"
#include "tests/support/zoom.h"

namespace cohort {
namespace {

test::SyntheticTracks SceneSeenBy(const Camera& camera) {
  test::SyntheticTracksOptions options;
  options.noise_px = 0.0;
  options.camera = camera;
  return test::MakeSyntheticTracks(options);
}

double LargestErrorPx(const Reconstruction& model) {
  double largest = 0.0;
  for (const auto& [frame, errors] : ReprojectionErrors(model)) {
    largest = std::max(largest, *std::max_element(errors.begin(), errors.end()));
  }
  return largest;
}

TEST(FocalScale, AFramesCameraHasItsOwnFocalLengthsAndAllElseOfTheOne) {
  Reconstruction model;
  model.camera = test::FreiburgCamera();
  model.focal_scale[FrameIndex{3}] = 1.5;
  const Camera of_frame = CameraOf(model, FrameIndex{3});
  EXPECT_EQ(of_frame.fx, 1.5 * model.camera.fx);
  EXPECT_EQ(of_frame.fy, 1.5 * model.camera.fy);
  EXPECT_EQ(of_frame.cx, model.camera.cx);
  EXPECT_EQ(of_frame.k3, model.camera.k3);
  EXPECT_EQ(CameraOf(model, FrameIndex{4}).fx, model.camera.fx) << "of a frame without a scale";
}

TEST(FocalScale, TheShortestAndTheLongestAreOfTheRegisteredFrames) {
  Reconstruction model;
  model.camera = test::SyntheticTracksOptions::DefaultCamera();
  EXPECT_EQ(FocalLengthsOf(model).min_px, model.camera.fx);
  model.focal_scale = {{FrameIndex{0}, 0.1}, {FrameIndex{1}, 0.5}, {FrameIndex{2}, 2.0}};
  for (const std::uint32_t frame : {1, 2, 3}) model.cam_from_world[FrameIndex{frame}] = {};
  EXPECT_EQ(FocalLengthsOf(model).min_px, 0.5 * model.camera.fx);
  EXPECT_EQ(FocalLengthsOf(model).max_px, 2.0 * model.camera.fx);
}

TEST(FocalScale, ViewsOfAZoomAreWhereTheFramesCamerasHaveTheirPoints) {
  for (const Camera& camera : {test::FreiburgCamera(), test::FisheyeCamera()}) {
    const test::SyntheticTracks still = SceneSeenBy(camera);
    const FocalScales scales = test::ZoomOf(still.file.frames);
    const test::SyntheticTracks zoomed = test::Zoomed(still, scales);
    EXPECT_LT(LargestErrorPx(test::ModelOfTruth(zoomed, scales)), 1e-8);
    EXPECT_GT(LargestErrorPx(test::ModelOfTruth(zoomed)), 50.0);
    const TrackSet back = AtOneFocalLength(zoomed.file.tracks, camera, scales);
    for (const Observation& o : back.observations()) {
      EXPECT_LT((o.xy - still.file.tracks.Find(o.feature, o.frame)->xy).norm(), 1e-9);
    }
  }
}

TEST(FocalScale, AGlobalShutterSeesAZoomWithTheFramesCameras) {
  const test::SyntheticTracks scene = SceneSeenBy(test::FreiburgCamera());
  Reconstruction model = test::ModelOfTruth(scene, test::ZoomOf(scene.file.frames));
  model.readout = 0.5;
  const RowPoses rows(model);
  std::vector<Observation> observations(scene.file.tracks.observations().begin(),
                                        scene.file.tracks.observations().end());
  const auto in_world = [&](const Observation& o) { return model.points.at(o.feature).in_world; };
  for (Observation& o : observations) {
    const auto xy = rows.Project(CameraOf(model, o.frame), o.frame, in_world(o));
    ASSERT_TRUE(xy);
    o.xy = *xy;
  }
  TrackFile rolling = scene.file;
  rolling.tracks = TrackSet::Build(std::move(observations));
  const TrackFile global = AsGlobalShutter(rolling, model);
  for (const Observation& o : global.tracks.observations()) {
    const auto xy =
        CameraOf(model, o.frame).Project(model.cam_from_world.at(o.frame) * in_world(o));
    ASSERT_TRUE(xy);
    EXPECT_LT((o.xy - *xy).norm(), 1e-4);
  }
}

}  // namespace
}  // namespace cohort
