#include "backend/adjust/working_model.h"

#include <gtest/gtest.h>

#include <limits>

#include "tests/support/synthetic_tracks.h"

namespace cohort {
namespace {

// The true scene, seen through observations that all claim this standard deviation.
double DepthUncertainty(test::SyntheticTracks scene, float sigma_px) {
  std::vector<Observation> observations;
  for (Observation o : scene.file.tracks.observations()) {
    o.covariance = PixelCovariance{sigma_px * sigma_px, 0.0F, sigma_px * sigma_px};
    observations.push_back(o);
  }
  scene.file.tracks = TrackSet::Build(std::move(observations));
  WhiteningOptions options;
  options.covariance_floor_px = 0.0;
  const WhitenedTracks whitened(scene.file, options);
  WorkingModel model(whitened, *scene.file.camera);
  for (int f = 0; f < whitened.frame_count(); ++f) {
    model.SetPose(f, scene.cam_from_world.at(whitened.frames()[f].index));
  }
  for (int t = 0; t < whitened.track_count(); ++t) {
    model.SetPoint(t, scene.points_in_world.at(whitened.features()[t]));
  }
  model.UpdateAllInliers(std::numeric_limits<double>::infinity());
  EXPECT_NEAR(model.noise(), 0.5 / sigma_px, 0.05 / sigma_px);
  return model.MedianDepthUncertainty();
}

TEST(WorkingModel, DepthUncertaintyIsOfTheNoiseFoundNotOfWhatObservationsClaim) {
  test::SyntheticTracksOptions options;
  options.path = test::CameraPath::kLateral;
  options.noise_px = 0.5;
  const test::SyntheticTracks scene = MakeSyntheticTracks(options);
  const double uncertainty = DepthUncertainty(scene, 0.5F);
  EXPECT_GT(uncertainty, 0.0);
  EXPECT_NEAR(DepthUncertainty(scene, 2.0F), uncertainty, 1e-6 * uncertainty);
  EXPECT_NEAR(DepthUncertainty(scene, 0.1F), uncertainty, 1e-6 * uncertainty);
}

TEST(WorkingModel, TheNearestRegisteredFramesAreByDistanceInTime) {
  const test::SyntheticTracks scene = test::MakeSyntheticTracks();
  const WhitenedTracks whitened(scene.file, {});
  WorkingModel model(whitened, *scene.file.camera);
  EXPECT_TRUE(model.NearestRegistered(5, 3).empty());
  for (const int f : {1, 4, 5, 9, 20}) model.SetPose(f, {});
  EXPECT_EQ(model.NearestRegistered(5, 3), (std::vector<int>{5, 4, 1}));
  EXPECT_EQ(model.NearestRegistered(7, 2), (std::vector<int>{5, 9}));
  EXPECT_EQ(model.NearestRegistered(23, 99), (std::vector<int>{20, 9, 5, 4, 1}));
}

TEST(IsWorse, OnlyBeyondWhatNoiseExplains) {
  EXPECT_FALSE(IsWorse(110.0, 100.0, 1.0));
  EXPECT_TRUE(IsWorse(130.0, 100.0, 1.0));
  EXPECT_FALSE(IsWorse(130.0, 100.0, 2.0));
  EXPECT_FALSE(IsWorse(100.001, 100.0, 0.0)) << "no clip is without noise";
}

}  // namespace
}  // namespace cohort
