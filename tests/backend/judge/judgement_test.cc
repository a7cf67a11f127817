#include "backend/judge/judgement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "backend/judge/doubts.h"
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
  EXPECT_FALSE(DoubtNoise(model));
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
