#include "pipelines/evaluation/model_evaluation.h"

#include <gtest/gtest.h>

#include <cmath>

#include "frontend/core/random_stream.h"

namespace cohort {
namespace {

constexpr std::uint32_t kFrames = 20;

struct Scene {
  Reconstruction reconstruction;
  ModelTruth truth;
  std::vector<FrameIndex> frames;
};

// A camera on an arc; the reconstruction is the truth in another world, with noise on the camera
// centres and points.
Scene MakeScene(double camera_noise_m = 0.0, double point_noise_m = 0.0) {
  RandomStream random(3, "model_evaluation_test");
  Sim3 model_from_truth;
  model_from_truth.scale = 0.25;
  model_from_truth.rotation = Eigen::Quaterniond(0.5, -0.1, 0.7, 0.2).normalized();
  model_from_truth.translation = {4.0, -5.0, 6.0};
  const auto jitter = [&](double noise_m) {
    return Eigen::Vector3d(
        noise_m * random.Gaussian(), noise_m * random.Gaussian(), noise_m * random.Gaussian());
  };
  Scene scene;
  for (std::uint32_t i = 0; i < kFrames; ++i) {
    const FrameIndex frame{2 * i};
    const double angle = 0.05 * i;
    Rigid3 world_from_cam{
        Eigen::Quaterniond(Eigen::AngleAxisd(-angle, Eigen::Vector3d::UnitY())),
        {5.0 * std::sin(angle), 0.1 * std::sin(3.0 * angle), 5.0 - 5.0 * std::cos(angle)}};
    scene.frames.push_back(frame);
    scene.truth.cam_from_world[frame] = world_from_cam.Inverse();
    world_from_cam.translation += jitter(camera_noise_m);
    scene.reconstruction.cam_from_world[frame] =
        TransformPose(model_from_truth, world_from_cam.Inverse());
  }
  std::map<std::uint32_t, Eigen::Vector3d> points;
  for (std::uint32_t f = 0; f < 50; ++f) {
    points[f] = {random.Gaussian(), random.Gaussian(), 6.0 + random.Gaussian()};
    Point3D point;
    point.in_world = model_from_truth * (points[f] + jitter(point_noise_m));
    point.views = {{FrameIndex{4}, {1.0 * f, 0.0}}, {FrameIndex{6}, {-1.0, 0.0}}};
    scene.reconstruction.points[FeatureId{f}] = point;
  }
  scene.truth.point = [points](FrameIndex frame, const Eigen::Vector2d& xy) {
    const auto found = points.find(static_cast<std::uint32_t>(xy.x()));
    return frame == FrameIndex{4} && found != points.end() && found->first < 40
               ? std::optional(found->second)
               : std::nullopt;
  };
  return scene;
}

TEST(EvaluateModel, ATrueModelInAnotherWorldHasNoError) {
  const Scene scene = MakeScene();
  const auto e = EvaluateModel(scene.reconstruction, scene.frames, scene.truth);
  EXPECT_EQ(e.registered, kFrames);
  EXPECT_EQ(e.frames, kFrames);
  EXPECT_NEAR(*e.scale, 4.0, 1e-12);
  EXPECT_LT(*e.ate_m, 1e-12);
  EXPECT_LT(*e.rpe_rot_deg, 1e-10);
  EXPECT_LT(*e.rpe_trans_m, 1e-12);
  EXPECT_LT(*e.point_error_median_m, 1e-11);
  EXPECT_EQ(e.points_with_truth, 40u);
  EXPECT_NEAR(*e.auc_5, 1.0, 1e-9);
  EXPECT_NEAR(*e.auc_20, 1.0, 1e-9);
}

TEST(EvaluateModel, NoiseIsFoundAtItsSize) {
  const double noise_m = 0.02;
  Scene scene = MakeScene(noise_m);
  auto e = EvaluateModel(scene.reconstruction, scene.frames, scene.truth);
  // sqrt(3) sigma, less what the 7 parameters of the alignment take of 3 n values.
  EXPECT_NEAR(*e.ate_m, noise_m * std::sqrt(3.0 * (1.0 - 7.0 / (3.0 * kFrames))), 0.004);
  EXPECT_NEAR(*e.rpe_trans_m, noise_m * std::sqrt(6.0), 0.012);
  EXPECT_LT(*e.rpe_rot_deg, 1e-10);
  EXPECT_LT(*e.auc_5, *e.auc_10);
  EXPECT_LT(*e.auc_10, *e.auc_20);

  scene = MakeScene(0.0, noise_m);
  e = EvaluateModel(scene.reconstruction, scene.frames, scene.truth);
  EXPECT_LT(*e.ate_m, 1e-12);
  // The median of a chi distribution with three degrees of freedom.
  EXPECT_NEAR(*e.point_error_median_m, 1.538 * noise_m, 0.008);
}

TEST(EvaluateModel, FramesThatAreNotRegisteredAreFailures) {
  Scene scene = MakeScene();
  for (std::uint32_t i = 0; i < kFrames / 2; ++i) {
    scene.reconstruction.cam_from_world.erase(FrameIndex{2 * i});
  }
  const auto e = EvaluateModel(scene.reconstruction, scene.frames, scene.truth);
  EXPECT_EQ(e.registered, kFrames / 2);
  EXPECT_LT(*e.ate_m, 1e-12);
  EXPECT_NEAR(*e.auc_5, (10.0 * 9.0) / (20.0 * 19.0), 1e-9);
  EXPECT_NEAR(*e.auc_20, (10.0 * 9.0) / (20.0 * 19.0), 1e-9);
}

TEST(EvaluateModel, FramesWithoutTruthAreLeftOut) {
  Scene scene = MakeScene();
  scene.truth.cam_from_world.erase(FrameIndex{0});
  scene.reconstruction.cam_from_world[FrameIndex{0}].translation = {100.0, 0.0, 0.0};
  scene.reconstruction.cam_from_world[FrameIndex{1}] = {};  // not one of the clip's frames
  const auto e = EvaluateModel(scene.reconstruction, scene.frames, scene.truth);
  EXPECT_EQ(e.registered, kFrames);
  EXPECT_LT(*e.ate_m, 1e-12);
  EXPECT_NEAR(*e.auc_5, 1.0, 1e-9);
}

// As a rail or a motorway: the model may turn about the path, so the points have no error, but
// every figure of the cameras stands.
TEST(EvaluateModel, OnAStraightPathOnlyThePointsHaveNoFigure) {
  Scene scene = MakeScene();
  const double noise_m = 0.01;
  double along_squares = 0.0;
  double along_sum = 0.0;
  double index_squares = 0.0;
  double index_along = 0.0;
  const double middle = (kFrames - 1) / 2.0;
  for (std::uint32_t i = 0; i < kFrames; ++i) {
    const FrameIndex frame = scene.frames[i];
    const double error = noise_m * (i % 3 == 0 ? 1.0 : -0.5);
    Rigid3 world_from_cam = scene.truth.cam_from_world[frame].Inverse();
    world_from_cam.translation = {0.0, 0.0, 0.5 * i};
    scene.truth.cam_from_world[frame] = world_from_cam.Inverse();
    world_from_cam.translation.z() += error;
    scene.reconstruction.cam_from_world[frame] = world_from_cam.Inverse();
    const double along = 0.5 * i + error;
    along_sum += along / kFrames;
    along_squares += along * along / kFrames;
    index_along += 0.5 * (i - middle) * along / kFrames;
    index_squares += 0.25 * (i - middle) * (i - middle) / kFrames;
  }
  const auto e = EvaluateModel(scene.reconstruction, scene.frames, scene.truth);
  EXPECT_EQ(e.alignment, AlignmentStatus::kFreeAboutALine);
  // Regression of the true place on the estimated one (alignment_test).
  const double variance = along_squares - along_sum * along_sum;
  EXPECT_NEAR(*e.scale, index_along / variance, 1e-9);
  EXPECT_NEAR(*e.ate_m, std::sqrt(index_squares - index_along * index_along / variance), 1e-9);
  EXPECT_GT(*e.ate_m, 0.5 * noise_m);
  EXPECT_TRUE(e.rpe_trans_m && e.rpe_rot_deg && e.auc_5);
  EXPECT_FALSE(e.point_error_median_m);
  EXPECT_EQ(e.points_with_truth, 0u);
}

TEST(EvaluateModel, AFigureThatCannotBeComputedIsAbsent) {
  Scene scene = MakeScene();
  while (scene.reconstruction.cam_from_world.size() > 2) {
    scene.reconstruction.cam_from_world.erase(scene.reconstruction.cam_from_world.begin());
  }
  auto e = EvaluateModel(scene.reconstruction, scene.frames, scene.truth);
  EXPECT_EQ(e.registered, 2u);
  EXPECT_FALSE(e.ate_m || e.rpe_rot_deg || e.rpe_trans_m || e.point_error_median_m || e.auc_5 ||
               e.auc_10 || e.auc_20 || e.scale);

  // A camera that only turns fixes no alignment, but its rotations can be judged.
  scene = MakeScene();
  for (auto& [frame, pose] : scene.truth.cam_from_world) {
    pose.translation.setZero();
    scene.reconstruction.cam_from_world[frame] = pose;
  }
  e = EvaluateModel(scene.reconstruction, scene.frames, scene.truth);
  EXPECT_EQ(e.alignment, AlignmentStatus::kOnePlace);
  EXPECT_FALSE(e.ate_m || e.rpe_trans_m || e.point_error_median_m || e.scale);
  EXPECT_LT(*e.rpe_rot_deg, 1e-10);
  EXPECT_NEAR(*e.auc_5, 1.0, 1e-9);

  scene = MakeScene();
  scene.truth.point = nullptr;
  e = EvaluateModel(scene.reconstruction, scene.frames, scene.truth);
  EXPECT_TRUE(e.ate_m);
  EXPECT_FALSE(e.point_error_median_m);
}

}  // namespace
}  // namespace cohort
