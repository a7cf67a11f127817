#include "backend/scene/spread_tracks.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/backend/scene/true_model.h"

namespace cohort {
namespace {

using test::AllFrames;
using test::LateralScene;
using test::SyntheticTracks;

// Of 8 x 6.
Eigen::Vector2d Cell(const WhitenedTracks& tracks, int observation) {
  const Eigen::Vector2d& xy = tracks.observations()[observation].xy;
  return (xy.cwiseMax(0.0).cwiseMin(Eigen::Vector2d(639.0, 479.0)) / 80.0).array().floor();
}

TEST(SpreadTracks, LeavesNoPartOfAPictureWithoutThatHasTracks) {
  const SyntheticTracks scene = LateralScene();
  const WhitenedTracks whitened(scene.file, {});
  const std::vector<int> frames = AllFrames(whitened);
  const std::vector<int> tracks = SpreadTracks(whitened, *scene.file.camera, frames, 1);
  EXPECT_LT(static_cast<int>(tracks.size()), whitened.track_count());
  EXPECT_TRUE(std::is_sorted(tracks.begin(), tracks.end()));
  const WhitenedTracks some = whitened.Select(tracks);
  for (const int frame : frames) {
    for (const int o : whitened.ObservationsIn(frame)) {
      EXPECT_TRUE(std::ranges::any_of(some.ObservationsIn(frame), [&](int kept) {
        return Cell(some, kept) == Cell(whitened, o);
      }));
    }
  }
}

TEST(SpreadTracks, PrefersLongOnes) {
  const SyntheticTracks scene = LateralScene();
  const WhitenedTracks whitened(scene.file, {});
  const WhitenedTracks some =
      whitened.Select(SpreadTracks(whitened, *scene.file.camera, AllFrames(whitened), 1));
  const auto mean_length = [](const WhitenedTracks& tracks) {
    return static_cast<double>(tracks.observations().size()) / tracks.track_count();
  };
  EXPECT_GT(mean_length(some), mean_length(whitened));
}

}  // namespace
}  // namespace cohort
