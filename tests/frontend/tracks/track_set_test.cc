#include "frontend/tracks/track_set.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace cohort {
namespace {

Observation At(std::uint32_t feature, std::uint32_t frame, double x, double y) {
  Observation o;
  o.feature = FeatureId{feature};
  o.frame = FrameIndex{frame};
  o.xy = {x, y};
  return o;
}

TEST(TrackSet, SortsAndIndexesByFeatureAndFrame) {
  const TrackSet set = TrackSet::Build({At(7, 2, 5, 6), At(3, 1, 1, 2), At(7, 1, 3, 4)});
  ASSERT_EQ(set.features().size(), 2u);
  EXPECT_EQ(set.features()[0], FeatureId{3});
  ASSERT_EQ(set.Track(FeatureId{7}).size(), 2u);
  EXPECT_EQ(set.Track(FeatureId{7})[0].frame, FrameIndex{1});
  ASSERT_EQ(set.InFrame(FrameIndex{1}).size(), 2u);
  EXPECT_EQ(set.InFrame(FrameIndex{1})[0]->feature, FeatureId{3});
  EXPECT_EQ(set.InFrame(FrameIndex{9}).size(), 0u);
  ASSERT_NE(set.Find(FeatureId{7}, FrameIndex{2}), nullptr);
  EXPECT_EQ(set.Find(FeatureId{7}, FrameIndex{2})->xy.x(), 5.0);
  EXPECT_EQ(set.Find(FeatureId{3}, FrameIndex{2}), nullptr);
}

TEST(TrackSet, IndexesSurviveACopy) {
  TrackSet copy;
  {
    const TrackSet set = TrackSet::Build({At(1, 1, 1, 2), At(2, 1, 3, 4)});
    copy = set;
  }
  EXPECT_EQ(copy.InFrame(FrameIndex{1})[1]->xy.y(), 4.0);
}

TEST(TrackSet, NamesTheFeatureAndFrameOfADuplicate) {
  EXPECT_THAT(
      [] {
        TrackSet::Build({At(4, 9, 1, 1), At(4, 8, 1, 1), At(4, 9, 2, 2)});
      },
      testing::ThrowsMessage<Error>(testing::HasSubstr("track 4 has two positions in frame 9")));
}

TEST(TrackSet, RefusesAPositionThatIsNotFinite) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT([&] { TrackSet::Build({At(4, 9, nan, 1)}); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("not finite in frame 9")));
}

TEST(TrackSet, CountsOnlyObservedPositionsInTrackLength) {
  Observation predicted = At(1, 2, 1, 1);
  predicted.state = ObservationState::kPredicted;
  const TrackSet set = TrackSet::Build({At(1, 1, 1, 1), predicted, At(2, 1, 3, 4)});
  EXPECT_EQ(set.CountObserved(), 2u);
  EXPECT_EQ(set.CountPredicted(), 1u);
  EXPECT_DOUBLE_EQ(set.MeanObservedLength(), 1.0);
}

TEST(TrackSet, AnEmptySetHasNoTracks) {
  const TrackSet set = TrackSet::Build({});
  EXPECT_TRUE(set.features().empty());
  EXPECT_DOUBLE_EQ(set.MeanObservedLength(), 0.0);
}

}  // namespace
}  // namespace cohort
