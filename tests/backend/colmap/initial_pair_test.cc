#include "backend/colmap/initial_pair.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>

#include "backend/scene/phrasebook.h"
#include "tests/support/synthetic_tracks.h"

namespace cohort {
namespace {

using test::CameraPath;
using test::MakeSyntheticTracks;
using test::SyntheticTracksOptions;
using testing::HasSubstr;

InitialPairs Search(const SyntheticTracksOptions& options, int most = 3) {
  const auto scene = MakeSyntheticTracks(options);
  return FindInitialPairs(scene.file, *scene.file.camera, most);
}

std::string WhyNone(const SyntheticTracksOptions& options) {
  const InitialPairs found = Search(options);
  EXPECT_TRUE(found.ranked.empty());
  return found.end ? TerminationLine(*found.end) : "";
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
    const InitialPairs found = Search(options);
    ASSERT_EQ(found.ranked.size(), 3u);
    std::set<FrameIndex> begun;
    for (const InitialPair& pair : found.ranked) {
      EXPECT_GE(ToInt(pair.frame1), 100u);
      EXPECT_LT(pair.frame1, pair.frame2);
      EXPECT_TRUE(begun.insert(pair.frame1).second);
      EXPECT_EQ(pair.geometry.kind, TwoViewKind::kCalibrated) << DescribeInitialPair(pair);
      EXPECT_GE(pair.geometry.inlier_count, 30u) << DescribeInitialPair(pair);
      EXPECT_GE(pair.geometry.angle_deg, path == CameraPath::kForward ? 1.5 : 3.0)
          << DescribeInitialPair(pair);
    }
  }
}

TEST(InitialPair, SaysWhyThereIsNone) {
  SyntheticTracksOptions options;
  options.path = CameraPath::kStatic;
  EXPECT_THAT(WhyNone(options), HasSubstr("static camera"));

  options.path = CameraPath::kRotation;
  EXPECT_THAT(WhyNone(options), HasSubstr("pure rotation"));

  options.path = CameraPath::kArc;
  options.points = 11;
  EXPECT_THAT(WhyNone(options), HasSubstr("no two keyframes that were tried share 12 tracks"));

  options.frames = 1;
  EXPECT_THAT(WhyNone(options), HasSubstr("the clip has 1 frame"));
}

TEST(InitialPair, DoesNotUsePredictedPositions) {
  auto scene = MakeSyntheticTracks();
  std::vector<Observation> observations(scene.file.tracks.observations().begin(),
                                        scene.file.tracks.observations().end());
  for (Observation& o : observations) {
    if (ToInt(o.frame) > 0) o.state = ObservationState::kPredicted;
  }
  scene.file.tracks = TrackSet::Build(observations);
  const InitialPairs found = FindInitialPairs(scene.file, *scene.file.camera, 3);
  EXPECT_TRUE(found.ranked.empty());
  EXPECT_TRUE(found.end);
}

}  // namespace
}  // namespace cohort
