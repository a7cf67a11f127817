#include "pipelines/evaluation/halves.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "frontend/geometry/sim3.h"

namespace cohort {
namespace {

using testing::ElementsAre;

constexpr int kFrames = 40;
using Cameras = std::map<FrameIndex, Rigid3>;

double Angle(int i) { return 2.0 * M_PI * i / kFrames; }

// A full circle of this radius in x and y, and `height` up and down along z twice as it goes round.
Cameras Circle(double radius, double height) {
  Cameras cameras;
  for (int i = 0; i < kFrames; ++i) {
    const Eigen::Vector3d centre(radius * std::cos(Angle(i)),
                                 radius * std::sin(Angle(i)),
                                 height * std::cos(2.0 * Angle(i)));
    const Eigen::Quaterniond rotation(Eigen::AngleAxisd(Angle(i), Eigen::Vector3d::UnitY()));
    cameras[FrameIndex(100U + 2U * i)] = {rotation, -(rotation * centre)};
  }
  return cameras;
}

Cameras Moved(Cameras cameras) {
  Sim3 world;
  world.scale = 7.0;
  world.rotation = Eigen::Quaterniond(0.8, 0.1, -0.5, 0.3).normalized();
  world.translation = {30.0, -10.0, 4.0};
  for (auto& [frame, cam_from_world] : cameras) {
    cam_from_world = TransformPose(world, cam_from_world);
  }
  return cameras;
}

TEST(CompareHalves, TheSamePathUpToASimilarityDisagreesByNothing) {
  const HalvesAgreement agreement =
      CompareHalves(Circle(2.0, 0.3), Moved(Circle(2.0, 0.3)), kFrames);
  EXPECT_EQ(agreement.frames_share, 1.0);
  ASSERT_TRUE(agreement.disagreement);
  EXPECT_NEAR(*agreement.disagreement, 0.0, 1e-12);
}

// Along z a circle gives nothing that a similarity could use: the best one leaves a circle of
// radius r against the wave of height h as they are, so that the sum of squares left is h^2 / 2 of
// the path's r^2 + h^2 / 2.
TEST(CompareHalves, AWaveAcrossTheCircleIsWhatNoSimilarityTakesAway) {
  constexpr double kRadius = 2.0, kHeight = 0.3;
  const double wave = kHeight * kHeight / 2.0;
  const double expected = std::sqrt(wave / (kRadius * kRadius + wave));
  const Cameras flat = Circle(kRadius, 0.0);
  const Cameras wavy = Moved(Circle(kRadius, kHeight));
  EXPECT_NEAR(CompareHalves(flat, wavy, kFrames).disagreement.value(), expected, 1e-12);
  EXPECT_NEAR(CompareHalves(wavy, flat, kFrames).disagreement.value(), expected, 1e-12);
}

TEST(CompareHalves, OnlyFramesOfBothCount) {
  Cameras first = Circle(2.0, 0.3);
  Cameras second = Moved(first);
  first.erase(first.begin());
  first.begin()->second.translation += Eigen::Vector3d(50.0, 0.0, 0.0);
  second.erase(std::next(second.begin()));
  const HalvesAgreement agreement = CompareHalves(first, second, kFrames);
  EXPECT_NEAR(agreement.frames_share, 38.0 / 40.0, 1e-12);
  EXPECT_NEAR(agreement.disagreement.value(), 0.0, 1e-12);
}

TEST(CompareHalves, AHalfWithFewFramesIsNoAgreement) {
  const Cameras whole = Circle(2.0, 0.3);
  Cameras part = whole;
  while (part.size() > 32) part.erase(part.begin());  // 80 %
  EXPECT_TRUE(CompareHalves(whole, part, kFrames).disagreement);
  part.erase(part.begin());
  EXPECT_FALSE(CompareHalves(whole, part, kFrames).disagreement);
  EXPECT_FALSE(CompareHalves(part, whole, kFrames).disagreement);
  EXPECT_NEAR(CompareHalves(part, whole, kFrames).frames_share, 31.0 / 40.0, 1e-12);
  EXPECT_FALSE(CompareHalves({}, whole, kFrames).disagreement);
}

TEST(CompareHalves, CamerasThatDoNotMoveDoNotAgree) {
  EXPECT_FALSE(CompareHalves(Circle(0.0, 0.0), Circle(0.0, 0.0), kFrames).disagreement);
}

TEST(SplitTracks, TakesFeaturesInTurnsWithAllThatIsKnownOfThem) {
  // An id is no index: these are all even.
  std::vector<Observation> observations;
  std::vector<TrackEnd> ends;
  for (const unsigned id : {8U, 2U, 40U, 6U, 10U}) {
    for (unsigned frame = 0; frame < id; ++frame) {
      Observation& o = observations.emplace_back();
      o.feature = FeatureId(id);
      o.frame = FrameIndex(frame);
      o.xy = {1.0 * id, 1.0 * frame};
    }
    ends.push_back({FeatureId(id), FrameIndex(id - 1), LossReason::kLeftImage});
  }
  const TrackSet whole = TrackSet::Build(observations, ends);
  const auto [first, second] = SplitTracks(whole);
  EXPECT_THAT(first.features(), ElementsAre(FeatureId(2), FeatureId(8), FeatureId(40)));
  EXPECT_THAT(second.features(), ElementsAre(FeatureId(6), FeatureId(10)));
  EXPECT_EQ(first.observations().size(), 2u + 8u + 40u);
  EXPECT_EQ(second.observations().size(), 6u + 10u);
  EXPECT_EQ(first.Find(FeatureId(8), FrameIndex(3))->xy, Eigen::Vector2d(8.0, 3.0));
  ASSERT_EQ(second.ends().size(), 2u);
  EXPECT_EQ(second.ends()[1].feature, FeatureId(10));
  EXPECT_EQ(second.ends()[1].last_frame, FrameIndex(9));
}

}  // namespace
}  // namespace cohort
