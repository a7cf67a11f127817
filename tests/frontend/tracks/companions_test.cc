#include "frontend/tracks/companions.h"

#include <gtest/gtest.h>

#include "frontend/core/random_stream.h"

namespace cohort {
namespace {

constexpr FeatureId kFirstOfSecond{1000};
constexpr double kWithinPx = 2.0;

void AddTrack(std::uint32_t feature,
              std::uint32_t first,
              std::uint32_t end,
              const Eigen::Vector2d& xy,
              std::vector<Observation>& observations) {
  for (std::uint32_t f = first; f < end; ++f) {
    Observation& o = observations.emplace_back();
    o.feature = FeatureId{feature};
    o.frame = FrameIndex{f};
    o.xy = xy + Eigen::Vector2d(3.0 * f, 1.0 * f);
  }
}

TEST(Companions, ATwinIsLeftOutAndWhatOutlivesTheOtherStays) {
  std::vector<Observation> observations;
  AddTrack(3, 0, 20, {50, 50}, observations);
  AddTrack(4, 0, 5, {100, 50}, observations);       // lost early
  AddTrack(1000, 0, 18, {50.8, 50}, observations);  // of 3
  AddTrack(1001, 0, 20, {100, 50.5}, observations);
  AddTrack(1002, 2, 20, {200, 90}, observations);
  const CompanionTracks both{
      TrackSet::Build(std::move(observations), {{FeatureId{1001}, FrameIndex{19}}}),
      kFirstOfSecond};

  const CompanionTracks joined = JoinCompanions(both, kWithinPx);
  ASSERT_EQ(joined.tracks.features().size(), 4u);
  EXPECT_EQ(joined.first_companion, FeatureId{5});
  EXPECT_EQ(joined.tracks.Track(FeatureId{5}).size(), 20u) << "outlives feature 4";
  EXPECT_EQ(joined.tracks.Track(FeatureId{6}).size(), 18u);
  ASSERT_EQ(joined.tracks.ends().size(), 1u);
  EXPECT_EQ(joined.tracks.ends()[0].feature, FeatureId{5});
  // Too few twins say nothing of how good the companion is.
  EXPECT_FALSE(joined.tracks.Track(FeatureId{5})[0].covariance);
}

TEST(Companions, TwinsTellHowGoodTheOthersAre) {
  constexpr double kSigmaPx = 0.6;
  std::vector<Observation> observations;
  for (std::uint32_t i = 0; i < 30; ++i) {
    AddTrack(i, 0, 20, {20.0 + 15.0 * i, 40}, observations);
    AddTrack(1000 + i, 0, 20, {20.5 + 15.0 * i, 40}, observations);
  }
  AddTrack(1100, 0, 20, {40, 200}, observations);
  RandomStream noise(1, "companions_test");
  for (Observation& o : observations) {
    if (o.feature < kFirstOfSecond) continue;
    const double x = noise.Gaussian();
    const double y = noise.Gaussian();
    o.xy += kSigmaPx * Eigen::Vector2d(x, y);
  }
  const CompanionTracks joined =
      JoinCompanions({TrackSet::Build(std::move(observations)), kFirstOfSecond}, kWithinPx);
  ASSERT_EQ(joined.tracks.features().size(), 31u);
  const auto track = joined.tracks.Track(joined.first_companion);
  ASSERT_TRUE(track[0].covariance);
  EXPECT_NEAR(std::sqrt(track[0].covariance->xx), kSigmaPx, 0.1);
  EXPECT_FALSE(joined.tracks.Track(FeatureId{0})[0].covariance);
}

// Between frames 9 and 10 it loses nearly all, between 29 and 30 ten of 16.
TEST(Companions, ATrackerIsWeakWhereItLosesItsFeatures) {
  std::vector<Observation> observations;
  for (std::uint32_t i = 0; i < 10; ++i) {
    AddTrack(i, 0, i == 0 ? 20 : 10, {20.0 + 15.0 * i, 40}, observations);
    AddTrack(100 + i, 10, 30, {20.0 + 15.0 * i, 80}, observations);
    AddTrack(200 + i, i < 4 ? 30 : 25, 40, {20.0 + 15.0 * i, 120}, observations);
  }
  const TrackSet tracks = TrackSet::Build(std::move(observations));
  const std::vector<Stretch> stretches = WeakStretches(tracks, 0.7, 5);
  ASSERT_EQ(stretches.size(), 2u);
  EXPECT_EQ(stretches[0].first, FrameIndex{4});
  EXPECT_EQ(stretches[0].last, FrameIndex{15});
  EXPECT_EQ(stretches[1].first, FrameIndex{24});
  EXPECT_EQ(stretches[1].last, FrameIndex{35});
  EXPECT_EQ(WeakStretches(tracks, 0.7, 10).size(), 1u) << "they meet";
  EXPECT_TRUE(WeakStretches(tracks, 0.0, 5).empty());
}

// In the dark corners are found one after another.
TEST(Companions, ATrackerThatIsStillFindingFeaturesLosesNone) {
  std::vector<Observation> observations;
  for (std::uint32_t i = 0; i < 20; ++i) AddTrack(i, i, 60, {20.0 + 15.0 * i, 40}, observations);
  const TrackSet growing = TrackSet::Build(observations);
  EXPECT_TRUE(WeakStretches(growing, 0.7, 5).empty());

  std::erase_if(observations, [](const Observation& o) {
    return o.feature >= FeatureId{6} && (o.frame == FrameIndex{40} || o.frame == FrameIndex{41});
  });
  const std::vector<Stretch> stretches =
      WeakStretches(TrackSet::Build(std::move(observations)), 0.7, 5);
  ASSERT_EQ(stretches.size(), 1u);
  EXPECT_EQ(stretches[0].first, FrameIndex{34});
  EXPECT_EQ(stretches[0].last, FrameIndex{47});
}

// Between frames 9 and 10 the first tracker loses nearly all.
TEST(Companions, OnlyThoseAreKeptThatBridgeWhatTheTrackerLoses) {
  std::vector<Observation> observations;
  for (std::uint32_t i = 0; i < 10; ++i) {
    AddTrack(i, 0, i == 0 ? 20 : 10, {20.0 + 15.0 * i, 40}, observations);
    AddTrack(100 + i, 10, 20, {20.0 + 15.0 * i, 80}, observations);
    AddTrack(1000 + i, 5, 15, {20.0 + 15.0 * i, 120}, observations);  // across
    AddTrack(1100 + i, 12, 20, {20.0 + 15.0 * i, 160}, observations);
  }
  const CompanionTracks kept =
      KeepWhereNeeded({TrackSet::Build(std::move(observations)), kFirstOfSecond}, 0.5);
  ASSERT_EQ(kept.tracks.features().size(), 30u);
  EXPECT_EQ(kept.tracks.features().back(), FeatureId{1009});
}

// Two features that go beside each other for a few frames are two.
TEST(Companions, WhatCrossesIsNoTwin) {
  std::vector<Observation> observations;
  AddTrack(0, 0, 20, {50, 50}, observations);
  AddTrack(1000, 0, 20, {20, 40}, observations);
  for (Observation& o : observations) {
    if (o.feature == FeatureId{1000}) o.xy += 3.0 * ToInt(o.frame) * Eigen::Vector2d(1, 0.33);
  }
  const TrackSet left = DropTwins({TrackSet::Build(std::move(observations)), kFirstOfSecond}, 2.0);
  EXPECT_EQ(left.features().size(), 2u);
}

}  // namespace
}  // namespace cohort
