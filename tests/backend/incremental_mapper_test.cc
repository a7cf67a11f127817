#include "backend/scene/incremental_mapper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/synthetic_tracks.h"

namespace cohort {
namespace {

using test::AbsoluteTrajectoryError;
using test::CameraPath;
using test::MakeSyntheticTracks;
using test::SyntheticTracks;
using test::SyntheticTracksOptions;

double Ate(const MapperResult& result, const SyntheticTracks& scene) {
  return AbsoluteTrajectoryError(result.reconstruction.cam_from_world, scene.cam_from_world);
}

TEST(IncrementalMapper, RecoversANoiseFreeScene) {
  for (const CameraPath path : {CameraPath::kArc, CameraPath::kLateral, CameraPath::kForward}) {
    SyntheticTracksOptions options;
    options.path = path;
    options.noise_px = 0.0;
    const SyntheticTracks scene = MakeSyntheticTracks(options);
    const MapperResult result = ReconstructWithCeres(scene.file);
    ASSERT_EQ(result.termination, MapperTermination::kSuccess) << result.summary.Brief();
    EXPECT_EQ(result.summary.registered, 24u);
    EXPECT_LT(Ate(result, scene), 1e-6);
  }
}

}  // namespace
}  // namespace cohort
