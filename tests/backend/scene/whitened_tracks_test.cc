#include "backend/scene/whitened_tracks.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/backend/scene/true_model.h"

namespace cohort {
namespace {

// Nine of ten tracks end after the frame; what they go on to see is another feature's.
TrackFile BrokenAfter(FrameIndex frame, TrackFile file) {
  constexpr std::uint32_t kOther = 100000;
  std::vector<Observation> observations;
  for (Observation o : file.tracks.observations()) {
    if (o.frame > frame && ToInt(o.feature) % 10 != 0) {
      o.feature = FeatureId{ToInt(o.feature) + kOther};
    }
    observations.push_back(o);
  }
  file.tracks = TrackSet::Build(std::move(observations));
  return file;
}

TEST(WhitenedTracks, HasASeamWhereFewTracksTieNeighbouringFrames) {
  const test::SyntheticTracks scene = test::LateralScene();
  EXPECT_FALSE(WhitenedTracks(scene.file, {}).HasSeam());
  const FrameIndex middle = scene.file.frames[scene.file.frames.size() / 2].index;
  EXPECT_TRUE(WhitenedTracks(BrokenAfter(middle, scene.file), {}).HasSeam());
}

}  // namespace
}  // namespace cohort
