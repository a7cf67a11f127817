#include "backend/adjust/bundle_adjustment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "backend/scene/reprojection.h"
#include "frontend/core/error.h"
#include "frontend/core/interruption.h"
#include "frontend/core/random_stream.h"
#include "tests/support/cameras.h"

namespace cohort {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

Camera DistortedCamera() {
  Camera camera;
  camera.width_px = 640;
  camera.height_px = 480;
  camera.fx = 500;
  camera.fy = 510;
  camera.cx = 322;
  camera.cy = 238;
  camera.k1 = -0.12;
  camera.k2 = 0.05;
  camera.p1 = 0.001;
  camera.p2 = -0.002;
  return camera;
}

Vector3d RandomVector(RandomStream& random, double size) {
  // One after the other: compilers draw the arguments of a call in orders of their own.
  const double z = random.Uniform(-1, 1);
  const double y = random.Uniform(-1, 1);
  return size * Vector3d(random.Uniform(-1, 1), y, z);
}

Eigen::Quaterniond Rotation(const Vector3d& omega) {
  const double angle = omega.norm();
  return Eigen::Quaterniond(
      Eigen::AngleAxisd(angle, angle > 0 ? Vector3d(omega / angle) : Vector3d::UnitX()));
}

CameraPose Moved(const CameraPose& pose, const Eigen::Matrix<double, 6, 1>& delta) {
  return {Rotation(delta.head<3>()) * pose.rotation, pose.center + delta.tail<3>()};
}

// Cameras on an arc around a cloud of points, every point seen by every camera.
struct Scene {
  BundleProblem truth;
  BundleProblem problem;  // measured with noise, started away from the truth
};
Scene MakeScene(int cameras,
                int points,
                double noise_px,
                double start_error,
                std::uint64_t seed,
                const Camera& camera = DistortedCamera()) {
  RandomStream random(seed, "bundle_adjustment_test");
  Scene scene;
  scene.truth.intrinsics = camera;
  for (int i = 0; i < cameras; ++i) {
    const double angle = 0.6 * (i / (cameras - 1.0) - 0.5);
    const Vector3d center =
        Vector3d(5 * std::sin(angle), 0, 5 - 5 * std::cos(angle)) + RandomVector(random, 0.1);
    const Eigen::Quaterniond rotation = Rotation({0, angle, 0});
    scene.truth.cameras.push_back({{rotation, -(rotation * center)}});
  }
  for (int p = 0; p < points; ++p) {
    scene.truth.points_in_world.push_back(Vector3d(0, 0, 5) + RandomVector(random, 1.2));
  }
  for (int i = 0; i < cameras; ++i) {
    for (int p = 0; p < points; ++p) {
      const auto xy = scene.truth.intrinsics.Project(scene.truth.cameras[i].cam_from_world *
                                                     scene.truth.points_in_world[p]);
      const double noise_y = random.Gaussian();
      const Vector2d noise(random.Gaussian(), noise_y);
      scene.truth.observations.push_back({i, p, *xy + noise_px * noise});
    }
  }
  scene.problem = scene.truth;
  for (int i = 1; i < cameras; ++i) {
    Rigid3& pose = scene.problem.cameras[i].cam_from_world;
    pose.rotation = Rotation(RandomVector(random, start_error)) * pose.rotation;
    pose.translation += RandomVector(random, start_error);
  }
  for (Vector3d& x : scene.problem.points_in_world) x += RandomVector(random, start_error);
  return scene;
}

// Scales a solution about camera 0 (which is fixed) so that camera `k` is as far as in the truth.
void ScaleToTruth(BundleProblem& solution, const BundleProblem& truth, int k) {
  const auto center = [](const BundleProblem& p, int i) {
    return p.cameras[i].cam_from_world.Inverse().translation;
  };
  const Vector3d origin = center(truth, 0);
  const double scale = (center(truth, k) - origin).norm() / (center(solution, k) - origin).norm();
  for (std::size_t i = 1; i < solution.cameras.size(); ++i) {
    Rigid3& pose = solution.cameras[i].cam_from_world;
    const Vector3d c = origin + scale * (pose.Inverse().translation - origin);
    pose.translation = -(pose.rotation * c);
  }
  for (Vector3d& x : solution.points_in_world) x = origin + scale * (x - origin);
}

TEST(Reprojection, DerivativesMatchCentralDifferences) {
  RandomStream random(3, "reprojection_test");
  constexpr double kStep = 1e-6;
  for (int trial = 0; trial < 20; ++trial) {
    const CameraPose pose{Rotation(RandomVector(random, 1.0)), RandomVector(random, 1.0)};
    const Vector3d in_cam = Vector3d(0, 0, 3) + RandomVector(random, 1.0);
    const Vector3d x = pose.rotation.conjugate() * in_cam + pose.center;
    const NormalisedProjection p = ProjectNormalised(pose, x);
    EXPECT_LT((p.n - in_cam.hnormalized()).norm(), 1e-12);
    for (int k = 0; k < 6; ++k) {
      Eigen::Matrix<double, 6, 1> delta = Eigen::Matrix<double, 6, 1>::Zero();
      delta[k] = kStep;
      const Vector2d numeric = (ProjectNormalised(Moved(pose, delta), x).n -
                                ProjectNormalised(Moved(pose, -delta), x).n) /
                               (2 * kStep);
      EXPECT_LT((p.d_pose.col(k) - numeric).norm(), 1e-7) << "pose " << k;
    }
    for (int k = 0; k < 3; ++k) {
      const Vector3d delta = kStep * Vector3d::Unit(k);
      const Vector2d numeric =
          (ProjectNormalised(pose, x + delta).n - ProjectNormalised(pose, x - delta).n) /
          (2 * kStep);
      EXPECT_LT((p.d_point.col(k) - numeric).norm(), 1e-7) << "point " << k;
    }
  }
}

class ReprojectionOf : public testing::TestWithParam<Camera> {};

INSTANTIATE_TEST_SUITE_P(Cameras,
                         ReprojectionOf,
                         testing::Values(DistortedCamera(),
                                         test::FreiburgCamera(),
                                         test::RationalCamera(),
                                         test::FisheyeCamera()));

TEST_P(ReprojectionOf, PixelDerivativesMatchCentralDifferences) {
  const Camera camera = GetParam();
  for (const Vector2d& n : {Vector2d(0.3, -0.2), Vector2d(-0.5, 0.4), Vector2d(0.01, 0.02)}) {
    const PixelProjection p = ProjectPixel(camera, n);
    EXPECT_LT((p.xy - *camera.Project(n.homogeneous())).norm(), 1e-12);
    for (int k = 0; k < 2; ++k) {
      const Vector2d delta = 1e-6 * Vector2d::Unit(k);
      const Vector2d numeric =
          (ProjectPixel(camera, n + delta).xy - ProjectPixel(camera, n - delta).xy) / 2e-6;
      EXPECT_LT((p.d_n.col(k) - numeric).norm(), 1e-6);
    }
    for (int k = 0; k < 5; ++k) {
      const double step = k < 3 ? 1e-3 : 1e-6;
      IntrinsicVector delta = IntrinsicVector::Zero();
      delta[k] = step;
      const IntrinsicVector v = ToIntrinsicVector(camera);
      const Vector2d numeric = (ProjectPixel(WithIntrinsics(camera, v + delta), n).xy -
                                ProjectPixel(WithIntrinsics(camera, v - delta), n).xy) /
                               (2 * step);
      EXPECT_LT((p.d_intrinsics.col(k) - numeric).norm(), 1e-6) << "intrinsic " << k;
    }
  }
}

// Of the whole chain, from a pose and a point to the pixel.
TEST_P(ReprojectionOf, DerivativesByPoseAndPointMatchCentralDifferences) {
  const Camera camera = GetParam();
  RandomStream random(4, "reprojection_test");
  constexpr double kStep = 1e-6;
  for (int trial = 0; trial < 10; ++trial) {
    const CameraPose pose{Rotation(RandomVector(random, 1.0)), RandomVector(random, 1.0)};
    const Vector3d in_cam = Vector3d(0, 0, 3) + RandomVector(random, 1.0);
    const Vector3d x = pose.rotation.conjugate() * in_cam + pose.center;
    const auto pixel = [&](const CameraPose& p, const Vector3d& point) {
      return *camera.Project(p.rotation * (point - p.center));
    };
    const NormalisedProjection normalised = ProjectNormalised(pose, x);
    const Eigen::Matrix2d d_n = ProjectPixel(camera, normalised.n).d_n;
    for (int k = 0; k < 6; ++k) {
      Eigen::Matrix<double, 6, 1> delta = Eigen::Matrix<double, 6, 1>::Zero();
      delta[k] = kStep;
      const Vector2d numeric =
          (pixel(Moved(pose, delta), x) - pixel(Moved(pose, -delta), x)) / (2 * kStep);
      EXPECT_LT((d_n * normalised.d_pose.col(k) - numeric).norm(), 1e-5) << "pose " << k;
    }
    for (int k = 0; k < 3; ++k) {
      const Vector3d delta = kStep * Vector3d::Unit(k);
      const Vector2d numeric = (pixel(pose, x + delta) - pixel(pose, x - delta)) / (2 * kStep);
      EXPECT_LT((d_n * normalised.d_point.col(k) - numeric).norm(), 1e-5) << "point " << k;
    }
  }
}

// Focal length, k1 and k2 found again, the other coefficients as they were given.
TEST_P(ReprojectionOf, BundleAdjustmentRefinesFocalLengthAndTwoCoefficients) {
  const Camera truth = GetParam();
  Scene scene = MakeScene(8, 80, 0.0, 0.02, 6, truth);
  scene.problem.intrinsics.fx *= 1.05;
  scene.problem.intrinsics.fy *= 1.05;
  scene.problem.intrinsics.k1 += 0.02;
  scene.problem.intrinsics.k2 -= 0.02;
  BundleOptions options;
  options.loss = RobustLoss::kNone;
  options.refine_focal = options.refine_radial = true;
  options.focal_prior_log_sigma = options.radial_prior_sigma = options.center_prior_sigma = 1e3;
  options.max_iterations = 200;
  options.function_tolerance = 1e-16;
  const BundleResult result = AdjustBundle(scene.problem, options);
  const Camera& found = result.solution.intrinsics;
  EXPECT_NEAR(found.fx, truth.fx, 0.01) << result.Brief();
  EXPECT_NEAR(found.fy, truth.fy, 0.01);
  EXPECT_NEAR(found.k1, truth.k1, 1e-3);
  EXPECT_NEAR(found.k2, truth.k2, 1e-3);
  for (const auto held : {&Camera::p1, &Camera::p2, &Camera::k3, &Camera::k4, &Camera::k5}) {
    EXPECT_EQ(found.*held, truth.*held);
  }
  EXPECT_EQ(found.model, truth.model);
}

TEST(BundleAdjustment, RecoversANoiseFreeScene) {
  const Scene scene = MakeScene(6, 40, 0.0, 0.05, 1);
  BundleOptions options;
  options.loss = RobustLoss::kNone;
  options.function_tolerance = 1e-16;
  BundleResult result = AdjustBundle(scene.problem, options);
  EXPECT_EQ(result.termination, BundleTermination::kConverged) << result.Brief();
  EXPECT_LT(result.final_cost, 1e-12);
  ScaleToTruth(result.solution, scene.truth, 5);
  for (int i = 0; i < 6; ++i) {
    const Rigid3& found = result.solution.cameras[i].cam_from_world;
    const Rigid3& truth = scene.truth.cameras[i].cam_from_world;
    EXPECT_LT(AngleBetween(found.rotation, truth.rotation), 1e-7);
    EXPECT_LT((found.translation - truth.translation).norm(), 1e-7);
  }
}

TEST(BundleAdjustment, KeepsTheFirstCameraAndTheBaseline) {
  const Scene scene = MakeScene(5, 40, 0.5, 0.05, 2);
  const BundleResult result = AdjustBundle(scene.problem, {});
  EXPECT_EQ(result.solution.cameras[0].cam_from_world.translation,
            scene.problem.cameras[0].cam_from_world.translation);
  const auto baseline = [](const BundleProblem& p, int k) {
    return (p.cameras[k].cam_from_world.Inverse().translation -
            p.cameras[0].cam_from_world.Inverse().translation)
        .norm();
  };
  EXPECT_NEAR(baseline(result.solution, 4), baseline(scene.problem, 4), 1e-12);
}

TEST(BundleAdjustment, RefinesIntrinsicsThatAreOff) {
  Scene scene = MakeScene(8, 80, 0.0, 0.02, 3);
  scene.problem.intrinsics.fx *= 1.2;
  scene.problem.intrinsics.fy *= 1.2;
  scene.problem.intrinsics.k1 = scene.problem.intrinsics.k2 = 0.0;
  scene.problem.intrinsics.cx += 5.0;
  BundleOptions options;
  options.loss = RobustLoss::kNone;
  options.refine_focal = options.refine_radial = options.refine_principal_point = true;
  options.focal_prior_log_sigma = options.radial_prior_sigma = options.center_prior_sigma = 1e3;
  options.max_iterations = 200;
  options.function_tolerance = 1e-14;
  const BundleResult result = AdjustBundle(scene.problem, options);
  EXPECT_NEAR(result.solution.intrinsics.fx, 500.0, 1e-2) << result.Brief();
  EXPECT_NEAR(result.solution.intrinsics.fy, 510.0, 1e-2);
  EXPECT_NEAR(result.solution.intrinsics.cx, 322.0, 1e-2);
  EXPECT_NEAR(result.solution.intrinsics.k1, -0.12, 1e-4);
}

TEST(BundleAdjustment, LossKeepsGrossOutliersFromMovingTheCameras) {
  double without_loss = 0.0;
  double with_loss = 0.0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    Scene scene = MakeScene(6, 60, 0.1, 0.01, seed);
    for (std::size_t i = 0; i < scene.problem.observations.size(); i += 12) {
      scene.problem.observations[i].xy += Vector2d(30, -20);
    }
    const auto rotation_error = [&](RobustLoss loss) {
      BundleOptions options;
      options.loss = loss;
      const BundleResult result = AdjustBundle(scene.problem, options);
      return AngleBetween(result.solution.cameras[5].cam_from_world.rotation,
                          scene.truth.cameras[5].cam_from_world.rotation);
    };
    without_loss += rotation_error(RobustLoss::kNone);
    with_loss += rotation_error(RobustLoss::kCauchy);
  }
  EXPECT_LT(2.0 * with_loss, without_loss);
}

TEST(BundleAdjustment, ObservationsOfLargeCovarianceCountLess) {
  Scene scene = MakeScene(6, 60, 0.0, 0.0, 5);
  // Half of the observations are wrong along x only and say so.
  for (std::size_t i = 0; i < scene.problem.observations.size(); i += 2) {
    scene.problem.observations[i].xy.x() += 10.0;
    scene.problem.observations[i].covariance_px2 = Vector2d(1e10, 1.0).asDiagonal();
  }
  BundleOptions options;
  options.loss = RobustLoss::kNone;
  BundleResult result = AdjustBundle(scene.problem, options);
  ScaleToTruth(result.solution, scene.truth, 5);
  EXPECT_LT((result.solution.cameras[5].cam_from_world.translation -
             scene.truth.cameras[5].cam_from_world.translation)
                .norm(),
            1e-6);
}

TEST(BundleAdjustment, CovariancesMatchTheScatterOfManyRuns) {
  constexpr int kRuns = 60;
  constexpr double kNoise = 0.5;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  Eigen::Matrix3d point_scatter = Eigen::Matrix3d::Zero();
  BundleCovariances predicted;
  for (int run = 0; run < kRuns; ++run) {
    // The same scene, other noise: the truth is drawn before the noise from the same stream.
    Scene scene = MakeScene(4, 30, 0.0, 0.0, 7);
    RandomStream noise = RandomStream(7, "noise").Fork(run);
    for (BundleObservation& o : scene.problem.observations) {
      o.xy += kNoise * Vector2d(noise.Gaussian(), noise.Gaussian());
      o.covariance_px2 = kNoise * kNoise * Eigen::Matrix2d::Identity();
    }
    BundleOptions options;
    options.loss = RobustLoss::kNone;
    options.covariances = run == 0;
    const BundleResult result = AdjustBundle(scene.problem, options);
    if (run == 0) {
      ASSERT_TRUE(result.covariances);
      predicted = *result.covariances;
    }
    const Vector3d error = result.solution.cameras[2].cam_from_world.Inverse().translation -
                           scene.truth.cameras[2].cam_from_world.Inverse().translation;
    const Vector3d point_error =
        result.solution.points_in_world[3] - scene.truth.points_in_world[3];
    scatter += error * error.transpose() / kRuns;
    point_scatter += point_error * point_error.transpose() / kRuns;
  }
  EXPECT_TRUE(predicted.cameras[0].isZero());  // the gauge
  const double ratio = scatter.trace() / predicted.cameras[2].bottomRightCorner<3, 3>().trace();
  EXPECT_GT(ratio, 0.6);
  EXPECT_LT(ratio, 1.6);
  const double point_ratio = point_scatter.trace() / predicted.points[3].trace();
  EXPECT_GT(point_ratio, 0.6);
  EXPECT_LT(point_ratio, 1.6);
}

TEST(BundleAdjustment, EndsAtTheIterationAtWhichSomebodyInterruptsIt) {
  const Scene scene = MakeScene(6, 40, 0.3, 0.05, 1);
  BundleOptions options;
  options.function_tolerance = 1e-16;
  const BundleResult whole = AdjustBundle(scene.problem, options);
  ASSERT_GT(whole.iterations, 3);
  int checks = 0;
  {
    const InterruptionCheck check([&] {
      if (++checks == 4) ThrowError("enough");
    });
    EXPECT_THROW(AdjustBundle(scene.problem, options), Error);
  }
  EXPECT_EQ(checks, 4);
  // Asking changes nothing.
  const InterruptionCheck check([&] { ++checks; });
  const BundleResult asked = AdjustBundle(scene.problem, options);
  EXPECT_GT(checks, 4 + whole.iterations);
  EXPECT_EQ(asked.final_cost, whole.final_cost);
  // Covariances ask at every point, twice.
  checks = 0;
  options.covariances = true;
  EXPECT_TRUE(AdjustBundle(scene.problem, options).covariances.has_value());
  EXPECT_GT(checks, whole.iterations + 2 * 40);
  EXPECT_EQ(asked.solution.points_in_world.back(), whole.solution.points_in_world.back());
}

TEST(BundleAdjustment, NamesAnIndexOutOfRange) {
  Scene scene = MakeScene(3, 10, 0.0, 0.0, 6);
  scene.problem.observations[4].point = 10;
  EXPECT_THAT([&] { AdjustBundle(scene.problem, {}); },
              testing::ThrowsMessage<Error>(testing::HasSubstr("point 10")));
}

}  // namespace
}  // namespace cohort
