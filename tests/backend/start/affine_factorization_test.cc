#include "backend/start/affine_factorization.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "frontend/core/random_stream.h"

namespace cohort {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

struct AffineScene {
  std::vector<Rigid3> cam_from_world;
  std::vector<Vector3d> points;
  std::vector<AffineMeasurement> measurements;
};

// An object of size 1 seen from `distance` by cameras that turn around it; weak perspective, or
// true perspective.
AffineScene MakeScene(int frames, int points, double distance, bool perspective, double missing) {
  RandomStream random(1, "affine_factorization_test");
  AffineScene scene;
  for (int p = 0; p < points; ++p) {
    scene.points.emplace_back(random.Uniform(-1, 1), random.Uniform(-1, 1), random.Uniform(-1, 1));
  }
  for (int f = 0; f < frames; ++f) {
    const double s = f / (frames - 1.0) - 0.5;
    const Eigen::Quaterniond rotation(Eigen::AngleAxisd(0.7 * s, Vector3d::UnitY()) *
                                      Eigen::AngleAxisd(0.3 * s * s, Vector3d::UnitX()));
    scene.cam_from_world.push_back({rotation, Vector3d(0.1 * s, 0.05, distance * (1 + 0.1 * s))});
    for (int p = 0; p < points; ++p) {
      if (p >= 20 && random.Uniform() < missing) continue;
      const Vector3d x = scene.cam_from_world[f] * scene.points[p];
      const double z = perspective ? x.z() : scene.cam_from_world[f].translation.z();
      scene.measurements.push_back({f, p, x.head<2>() / z});
    }
  }
  return scene;
}

// Largest angle between relative rotations of the model and the truth, over frames [rad].
double RotationError(const AffineModel& model, const AffineScene& scene) {
  double worst = 0.0;
  for (std::size_t f = 1; f < scene.cam_from_world.size(); ++f) {
    const auto relative = [f](const std::vector<Rigid3>& poses) {
      return poses[f].rotation * poses[0].rotation.conjugate();
    };
    worst = std::max(worst,
                     AngleBetween(relative(model.cam_from_world), relative(scene.cam_from_world)));
  }
  return worst;
}

TEST(AffineFactorization, OneOfTheMirrorModelsIsTheSceneOfAWeakPerspectiveCamera) {
  const AffineScene scene = MakeScene(8, 60, 10.0, false, 0.3);
  const auto result = FactorizeAffine(8, 60, scene.measurements);
  ASSERT_TRUE(result);
  EXPECT_LT(result->rms_error, 1e-9);
  const double a = RotationError(result->mirror_models[0], scene);
  const double b = RotationError(result->mirror_models[1], scene);
  EXPECT_LT(std::min(a, b), 1e-6);
  EXPECT_GT(std::max(a, b), 0.1);
}

TEST(AffineFactorization, IsCloseUnderPerspectiveFromAfar) {
  const AffineScene scene = MakeScene(8, 60, 10.0, true, 0.0);
  const auto result = FactorizeAffine(8, 60, scene.measurements);
  ASSERT_TRUE(result);
  const double error = std::min(RotationError(result->mirror_models[0], scene),
                                RotationError(result->mirror_models[1], scene));
  EXPECT_LT(error, 0.1);
}

TEST(AffineFactorization, SurvivesWrongMeasurements) {
  AffineScene scene = MakeScene(10, 100, 10.0, false, 0.3);
  for (std::size_t i = 0; i < scene.measurements.size(); i += 20) {
    scene.measurements[i].n += Vector2d(0.1, -0.15);
  }
  const auto result = FactorizeAffine(10, 100, scene.measurements);
  ASSERT_TRUE(result);
  const double error = std::min(RotationError(result->mirror_models[0], scene),
                                RotationError(result->mirror_models[1], scene));
  EXPECT_LT(error, 0.02);
}

TEST(AffineFactorization, APlaneHasNoThirdDimension) {
  AffineScene scene = MakeScene(8, 60, 10.0, false, 0.0);
  scene.measurements.clear();
  for (int f = 0; f < 8; ++f) {
    for (int p = 0; p < 60; ++p) {
      const Vector3d flat(scene.points[p].x(), scene.points[p].y(), 0.0);
      const Vector3d x = scene.cam_from_world[f] * flat;
      scene.measurements.push_back({f, p, x.head<2>() / scene.cam_from_world[f].translation.z()});
    }
  }
  EXPECT_FALSE(FactorizeAffine(8, 60, scene.measurements));
}

TEST(AffineFactorization, NeedsThreeFramesAndEightCompleteTracks) {
  const AffineScene scene = MakeScene(8, 60, 10.0, false, 0.0);
  std::vector<AffineMeasurement> two;
  std::vector<AffineMeasurement> few;
  for (const AffineMeasurement& m : scene.measurements) {
    if (m.frame < 2) two.push_back(m);
    if (m.track < 7) few.push_back(m);
  }
  EXPECT_FALSE(FactorizeAffine(2, 60, two));
  EXPECT_FALSE(FactorizeAffine(8, 7, few));
}

}  // namespace
}  // namespace cohort
