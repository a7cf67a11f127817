#include "frontend/track/trajectory_model/projection.h"

#include <gtest/gtest.h>

#include "frontend/core/random_stream.h"
#include "tests/support/numeric_gradient.h"

namespace cohort::trajectory_model {
namespace {

constexpr Eigen::Index kRank = 3;

Camera SomeCamera(RandomStream& random) {
  Camera camera(3, kRank + 1);
  for (Eigen::Index p = 0; p <= kRank; ++p) {
    camera.col(p) << random.Uniform(-200, 200), random.Uniform(-200, 200),
        random.Uniform(-0.2, 0.2);
  }
  camera(2, 0) = 1.0;
  return camera;
}

TEST(Projection, DividesByTheDepth) {
  Camera camera(3, 2);
  camera << 300.0, 100.0,  //
      200.0, 0.0,          //
      1.0, 0.5;
  const Projection at = Project(camera, Vector::Constant(1, 2.0));
  EXPECT_DOUBLE_EQ(at.xy.x(), 250.0);
  EXPECT_DOUBLE_EQ(at.xy.y(), 100.0);
}

TEST(Projection, DerivativesMatchCentralDifferences) {
  RandomStream random(1, "test/projection");
  for (int i = 0; i < 20; ++i) {
    const Camera camera = SomeCamera(random);
    Vector z(kRank);
    for (double& entry : z) entry = random.Uniform(-1, 1);
    const Projection at = Project(camera, z);
    Vector homogeneous(kRank + 1);
    homogeneous << 1.0, z;
    for (int axis = 0; axis < 2; ++axis) {
      const Vector of_z = test::NumericGradient(
          [&](const Vector& v) { return Project(camera, v).xy[axis]; }, z, 1e-5);
      EXPECT_LT((of_z.transpose() - at.of_z.row(axis)).norm(), 1e-4 * at.of_z.norm());
      const Camera of_camera = test::NumericGradient(
          [&](const Camera& c) { return Project(c, z).xy[axis]; }, camera, 1e-5);
      const Eigen::MatrixXd expected =
          at.of_homogeneous.row(axis).transpose() * homogeneous.transpose();
      EXPECT_LT((of_camera - expected).norm(), 1e-4 * expected.norm());
    }
  }
}

TEST(Projection, StaysFiniteAtTheCamerasPlane) {
  Camera camera(3, 2);
  camera << 300.0, 100.0, 200.0, 0.0, 1.0, -1.0;
  for (const double z : {1.0, 5.0}) {  // depth 0, and behind the camera
    EXPECT_TRUE(Project(camera, Vector::Constant(1, z)).of_z.allFinite());
  }
}

TEST(Residual, HasTheAnchorsErrorButInTheAnchorsOwnFrame) {
  Camera camera(3, 2);
  camera << 300.0, 100.0, 200.0, 0.0, 1.0, 0.0;
  FeaturePosterior feature;
  feature.mean = Eigen::Vector3d(0.5, 0.2, -0.1);  // z, e
  Observation o;
  o.xy = {351.0, 200.0};
  const Projection at = Project(camera, feature.mean);
  EXPECT_LT((Residual(at, o, feature) - Eigen::Vector2d(0.8, 0.1)).norm(), 1e-12);
  o.anchor = true;
  EXPECT_LT((Residual(at, o, feature) - Eigen::Vector2d(1.0, 0.0)).norm(), 1e-12);
}

}  // namespace
}  // namespace cohort::trajectory_model
