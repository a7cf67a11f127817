#include "backend/judge/judgement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "backend/mapper/mapper.h"
#include "tests/backend/scene/true_model.h"

namespace cohort {
namespace {

using test::AllFrames;
using test::CameraPath;
using test::LateralScene;
using test::SyntheticTracks;
using test::TrueModel;
using testing::ElementsAre;
using testing::Field;
using testing::HasSubstr;
using testing::StartsWith;

TEST(Judgement, ATrueModelIsWorthReturningAndLeavesTheTracksNoise) {
  const SyntheticTracks scene = LateralScene(0.5);
  const WhitenedTracks whitened(scene.file, {});
  const std::vector<int> keyframes{0, 4, 8, 12, 16, 20};
  WorkingModel model = TrueModel(scene, whitened, AllFrames(whitened));
  const Judgement judgement = JudgeModel(model, *scene.file.camera, keyframes);
  EXPECT_FALSE(judgement.worthless);
  EXPECT_TRUE(judgement.doubts.empty());
  EXPECT_LT(UnexplainedParallax(model, keyframes), 0.2);
  EXPECT_NEAR(NoiseLeftPx(model), 0.5, 0.1);
  EXPECT_FALSE(DescribeExcessNoise(model));
}

TEST(Judgement, AModelWithoutDepthIsWorthless) {
  SyntheticTracks scene = LateralScene(0.5);
  const WhitenedTracks whitened(scene.file, {});
  WorkingModel model(whitened, *scene.file.camera);
  const Rigid3 still = scene.cam_from_world.at(whitened.frames()[0].index);
  for (int f = 0; f < whitened.frame_count(); ++f) model.SetPose(f, still);
  const Judgement judgement = JudgeModel(model, *scene.file.camera, {0, 8, 16});
  ASSERT_TRUE(judgement.worthless);
  EXPECT_THAT(judgement.worthless->detail, HasSubstr("depths are unknown: too little"));
  EXPECT_THAT(SentencesOf(judgement.doubts),
              ElementsAre(HasSubstr("depths are unknown: move"),
                          HasSubstr("none of the parallax is explained: the tracks drift")));
  EXPECT_THAT(judgement.doubts,
              ElementsAre(Field(&Doubt::code, DoubtCode::kWeakDepth),
                          Field(&Doubt::code, DoubtCode::kUnexplainedParallax)));
}

TEST(Judgement, SaysThatPointsLieAlongALine) {
  const auto reconstruct = [](double height) {
    test::SyntheticTracksOptions options;
    options.path = CameraPath::kLateral;
    options.height = height;
    options.plane_relief = height;
    return ReconstructWithCeres(MakeSyntheticTracks(options).file);
  };
  const MapperResult line = reconstruct(0.03);
  EXPECT_LT(SpreadAcrossLine(line.reconstruction), 0.06);
  const std::vector<Doubt>& reasons = line.summary.reasons;
  const auto doubt = std::ranges::find(reasons, DoubtCode::kPointsOnALine, &Doubt::code);
  ASSERT_NE(doubt, reasons.end());
  EXPECT_THAT(doubt->sentence, StartsWith("the points lie along a line, about"));
  EXPECT_THAT(
      doubt->figures,
      ElementsAre(testing::Pair("spread_across_line", SpreadAcrossLine(line.reconstruction))));
  EXPECT_EQ(line.summary.Quality(), ModelQuality::kDoubtful);
  const MapperResult flat = reconstruct(0.5);
  EXPECT_GT(SpreadAcrossLine(flat.reconstruction), 0.2);
  EXPECT_EQ(flat.summary.Quality(), ModelQuality::kGood);
}

// A stretch before a blank wall, where few features may drift together.
TEST(Judgement, SaysThatFewPointsHoldAStretch) {
  const auto model = [](std::uint32_t points, std::uint32_t in_stretch) {
    Reconstruction made;
    for (std::uint32_t f = 0; f < 40; ++f) made.cam_from_world[FrameIndex{f}] = {};
    for (std::uint32_t i = 0; i < points; ++i) {
      for (std::uint32_t f = 0; f < 40; ++f) {
        if (f >= 10 && f < 14 && i >= in_stretch) continue;
        made.points[FeatureId{i}].views.push_back({FrameIndex{f}, {1.0, 1.0}});
      }
    }
    return made;
  };
  const auto doubt = DescribeFewPoints(model(170, 42));
  ASSERT_TRUE(doubt);
  EXPECT_EQ(doubt->code, DoubtCode::kFewPoints);
  EXPECT_THAT(doubt->sentence, StartsWith("4 frames, the first of them 10 and the last 13, are"));
  EXPECT_THAT(doubt->figures,
              ElementsAre(testing::Pair("frames", 4.0),
                          testing::Pair("points", 42.0),
                          testing::Pair("median_points", 170.0)));
  EXPECT_FALSE(DescribeFewPoints(model(170, 90))) << "enough";
  EXPECT_FALSE(DescribeFewPoints(model(50, 40))) << "as many as all frames have";
  EXPECT_FALSE(DescribeFewPoints(Reconstruction()));
}

// Half of all clips are off by more than is expected.
TEST(Judgement, DoubtsWhatMayBeOffByMoreThanAHundredthOfThePath) {
  EXPECT_FALSE(DescribeExpectedError(0.0049));
  const auto doubt = DescribeExpectedError(0.0051);
  ASSERT_TRUE(doubt);
  EXPECT_EQ(doubt->code, DoubtCode::kCamerasUncertain);
}

TEST(SpreadAcrossLine, IsThatOfTheViewsInTheirPictures) {
  Reconstruction model;
  // Twice as far along the diagonal as across, in a frame; in the other nothing to tell by.
  const std::vector<Eigen::Vector2d> seen{{8, 8}, {12, 12}, {9, 11}, {11, 9}};
  for (std::uint32_t i = 0; i < seen.size(); ++i) {
    model.points[FeatureId{i}].views = {{FrameIndex{3}, seen[i]}};
  }
  model.points[FeatureId{9}].views = {{FrameIndex{4}, {1, 1}}};
  EXPECT_NEAR(SpreadAcrossLine(model), 0.5, 1e-12);
  EXPECT_EQ(SpreadAcrossLine(Reconstruction()), 1.0);
}

TEST(Judgement, SaysWhyAClipHasNoParallax) {
  const auto judge = [](CameraPath path) {
    test::SyntheticTracksOptions options;
    options.path = path;
    const SyntheticTracks scene = MakeSyntheticTracks(options);
    const WhitenedTracks whitened(scene.file, {});
    const Camera& camera = *scene.file.camera;
    const auto widest = WidestPairsOf(whitened, RankPairs(whitened, camera, {0, 8, 16}));
    return DescribeClipWithoutParallax(widest, camera, EstimateNoise(whitened));
  };
  EXPECT_FALSE(judge(CameraPath::kLateral));
  ASSERT_TRUE(judge(CameraPath::kStatic));
  EXPECT_EQ(judge(CameraPath::kStatic)->termination, MapperTermination::kStaticCamera);
  EXPECT_EQ(judge(CameraPath::kRotation)->termination, MapperTermination::kPureRotation);
}

}  // namespace
}  // namespace cohort
