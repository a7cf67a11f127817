#include "backend/adjust/adjustment.h"

#include <gtest/gtest.h>

#include "tests/backend/scene/true_model.h"

namespace cohort {
namespace {

using test::AllFrames;
using test::LateralScene;
using test::SyntheticTracks;
using test::TrueModel;

TEST(Adjustment, MovesWrongPosesBackAndHoldsThoseBeyond) {
  const SyntheticTracks scene = LateralScene(0.0);
  const WhitenedTracks whitened(scene.file, {});
  WorkingModel model = TrueModel(scene, whitened, AllFrames(whitened));
  const Rigid3 right = model.Pose(10);
  const Rigid3 far = model.Pose(20);
  Rigid3 wrong = right;
  wrong.translation += Eigen::Vector3d(0.02, -0.01, 0.01);
  model.SetPose(10, wrong);
  AdjustAround(model, 10);
  EXPECT_LT((model.Pose(10).translation - right.translation).norm(), 1e-3);
  EXPECT_EQ(model.Pose(20).translation, far.translation);
}

TEST(Adjustment, OfPointsKeepsThePoses) {
  const SyntheticTracks scene = LateralScene(0.0);
  const WhitenedTracks whitened(scene.file, {});
  WorkingModel model = TrueModel(scene, whitened, AllFrames(whitened));
  const Rigid3 pose = model.Pose(5);
  const Eigen::Vector3d point = model.Point(3);
  model.SetPoint(3, point + Eigen::Vector3d(0.01, 0.01, 0.05));
  AdjustPoints(model);
  EXPECT_EQ(model.Pose(5).translation, pose.translation);
  EXPECT_LT((model.Point(3) - point).norm(), 1e-5);
}

TEST(Adjustment, FindsABetterCameraOnlyWhereTheOneGivenIsWrong) {
  SyntheticTracks scene = LateralScene();
  const WhitenedTracks whitened(scene.file, {});
  const std::vector<int> keyframes{0, 4, 8, 12, 16, 20};
  EXPECT_FALSE(FindBetterCamera(TrueModel(scene, whitened, AllFrames(whitened)), keyframes));
  scene.file.camera->k1 = 0.2;
  const auto better = FindBetterCamera(TrueModel(scene, whitened, AllFrames(whitened)), keyframes);
  ASSERT_TRUE(better);
  EXPECT_LT(std::abs(better->k1), 0.1);
}

TEST(Adjustment, CovariancesScaleWithTheNoise) {
  std::vector<double> variances;
  for (const double noise_px : {0.2, 0.4}) {
    const SyntheticTracks scene = LateralScene(noise_px);
    const WhitenedTracks whitened(scene.file, {});
    WorkingModel model = TrueModel(scene, whitened, AllFrames(whitened));
    AdjustUntilSettled(model, 3, 5);
    const auto covariances = CovariancesAtOptimum(model, {});
    ASSERT_TRUE(covariances);
    EXPECT_EQ(covariances->cameras.size(), 24u);
    variances.push_back(covariances->cameras.at(FrameIndex{12}).trace());
  }
  EXPECT_NEAR(variances[1] / variances[0], 4.0, 1.0);
}

}  // namespace
}  // namespace cohort
