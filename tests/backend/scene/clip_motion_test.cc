#include "backend/scene/clip_motion.h"

#include <gtest/gtest.h>

#include "tests/support/synthetic_tracks.h"

namespace cohort {
namespace {

using test::CameraPath;

test::SyntheticTracksOptions Drifting(CameraPath path) {
  test::SyntheticTracksOptions options;
  options.path = path;
  options.frames = 40;
  options.drift_px = 0.5;
  return options;
}

ClipMotion MotionByDirection(const TrackFile& file, const Camera& camera) {
  const WhitenedTracks whitened(file, {});
  const std::vector<int> keyframes = SelectKeyframes(whitened, camera, 10.0, 10);
  return ClassifyDrift(whitened, camera, RankPairs(whitened, camera, keyframes));
}

TEST(ClassifyDrift, ParallaxLiesAlongTheEpipolarLinesAndDriftDoesNot) {
  for (const auto& [path, motion] : {std::pair(CameraPath::kStatic, ClipMotion::kStatic),
                                     std::pair(CameraPath::kRotation, ClipMotion::kRotation),
                                     std::pair(CameraPath::kLateral, ClipMotion::kParallax),
                                     std::pair(CameraPath::kForward, ClipMotion::kParallax),
                                     std::pair(CameraPath::kArc, ClipMotion::kParallax)}) {
    const TrackFile file = MakeSyntheticTracks(Drifting(path)).file;
    EXPECT_EQ(MotionByDirection(file, *file.camera), motion) << static_cast<int>(path);
  }
}

TEST(ClassifyDrift, SaysNothingWithoutPairs) {
  const TrackFile file = MakeSyntheticTracks(Drifting(CameraPath::kStatic)).file;
  EXPECT_EQ(ClassifyDrift(WhitenedTracks(file, {}), *file.camera, {}), ClipMotion::kParallax);
}

}  // namespace
}  // namespace cohort
