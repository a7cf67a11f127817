#include "backend/start/initial_pair.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/synthetic_tracks.h"

namespace cohort {
namespace {

using test::CameraPath;
using test::MakeSyntheticTracks;
using test::SyntheticTracksOptions;

InitialPairSearch Search(const SyntheticTracksOptions& options) {
  const auto scene = MakeSyntheticTracks(options);
  return FindInitialPairs(scene.file.tracks, *scene.file.camera);
}

TEST(InitialPair, HasParallaxAndManyMatches) {
  for (const auto path : {CameraPath::kArc, CameraPath::kLateral, CameraPath::kForward}) {
    SyntheticTracksOptions options;
    options.path = path;
    options.frames = 60;
    options.max_track_length = 30;
    options.points = 600;
    options.outlier_fraction = 0.05;
    options.first_frame = 100;
    options.frame_stride = 2;
    const InitialPairSearch search = Search(options);
    ASSERT_FALSE(search.ranked.empty()) << search.reason;
    const InitialPair& best = search.ranked.front();
    EXPECT_GE(ToInt(best.frame1), 100u);
    EXPECT_LT(best.frame1, best.frame2);
    EXPECT_EQ(best.geometry.kind, TwoViewKind::kCalibrated) << search.reason;
    EXPECT_GE(best.geometry.inlier_count, 30u) << search.reason;
    EXPECT_GE(best.geometry.angle_deg, path == CameraPath::kForward ? 1.5 : 5.0) << search.reason;
    EXPECT_TRUE(std::is_sorted(search.ranked.begin(),
                               search.ranked.end(),
                               [](const auto& a, const auto& b) { return a.score > b.score; }));
    EXPECT_THAT(search.reason, testing::HasSubstr("initial pair: frames"));
  }
}

TEST(InitialPair, SaysWhyThereIsNone) {
  SyntheticTracksOptions options;
  options.path = CameraPath::kStatic;
  EXPECT_THAT(Search(options).reason, testing::HasSubstr("stands still"));
  EXPECT_TRUE(Search(options).ranked.empty());

  options.path = CameraPath::kRotation;
  EXPECT_THAT(Search(options).reason, testing::HasSubstr("turns on the spot"));
  EXPECT_TRUE(Search(options).ranked.empty());

  options.path = CameraPath::kArc;
  options.points = 12;
  EXPECT_THAT(Search(options).reason, testing::HasSubstr("too few tracks in common"));

  options.frames = 1;
  EXPECT_THAT(Search(options).reason, testing::HasSubstr("fewer than two frames"));
  EXPECT_THAT(FindInitialPairs(TrackSet(), options.camera).reason,
              testing::HasSubstr("fewer than two frames"));
}

TEST(InitialPair, DoesNotUsePredictedPositions) {
  const auto scene = MakeSyntheticTracks();
  std::vector<Observation> observations(scene.file.tracks.observations().begin(),
                                        scene.file.tracks.observations().end());
  for (Observation& o : observations) {
    if (ToInt(o.frame) > 0) o.state = ObservationState::kPredicted;
  }
  const auto search = FindInitialPairs(TrackSet::Build(observations), *scene.file.camera);
  EXPECT_THAT(search.reason, testing::HasSubstr("too few tracks in common"));
}

}  // namespace
}  // namespace cohort
