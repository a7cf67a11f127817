#include "frontend/track/trajectory_model/gauge.h"

#include <gtest/gtest.h>

#include "tests/frontend/track/trajectory_model/small_scene.h"

namespace cohort::trajectory_model {
namespace {

// Cameras that see depths of one mean, 0.8; coordinates that are not centred.
State Skewed() {
  State state = test::MakeSmallScene(40, 6, 3, true, 0.3).state;
  for (Frame& frame : state.frames) frame.camera.row(2).tail(3).array() += 0.05;
  for (FeaturePosterior& feature : state.features) feature.mean.head(3).array() += 0.3;
  return state;
}

// Projections, and their covariance by the coordinates'.
void ExpectSameProjections(const State& a, const State& b) {
  for (std::size_t l = 0; l < a.frames.size(); ++l) {
    for (std::size_t f = 0; f < a.features.size(); ++f) {
      const Projection p = Project(a.frames[l].camera, a.features[f].mean);
      const Projection q = Project(b.frames[l].camera, b.features[f].mean);
      EXPECT_LT((p.xy - q.xy).norm(), 1e-8);
      const auto covariance = [](const Projection& at, const FeaturePosterior& feature) {
        return Eigen::Matrix2d(at.of_z * feature.covariance.topLeftCorner(3, 3) *
                               at.of_z.transpose());
      };
      const Eigen::Matrix2d c = covariance(p, a.features[f]);
      EXPECT_LT((c - covariance(q, b.features[f])).norm(), 1e-8 * c.norm());
    }
  }
}

TEST(CenterDepths, ChangesNoProjectionAndMakesTheMeanDepthOne) {
  const State before = Skewed();
  State after = before;
  CenterDepths(after);
  ExpectSameProjections(before, after);
  Vector mean = Vector::Zero(3);
  for (const Frame& frame : after.frames) mean += frame.camera.row(2).tail(3).transpose();
  EXPECT_LT(mean.norm(), 1e-12);
}

TEST(NormalizeCoordinates, ChangesNoProjectionAndMakesTheCoordinatesStandardNormal) {
  const State before = Skewed();
  State after = before;
  NormalizeCoordinates(after);
  ExpectSameProjections(before, after);
  Vector mean = Vector::Zero(3);
  Matrix scatter = Matrix::Zero(3, 3);
  for (const FeaturePosterior& feature : after.features) {
    const Vector z = feature.mean.head(3);
    mean += z / 40.0;
    scatter += (z * z.transpose() + feature.covariance.topLeftCorner(3, 3)) / 40.0;
  }
  EXPECT_LT(mean.norm(), 1e-9);
  EXPECT_LT((scatter - Matrix::Identity(3, 3)).norm(), 1e-6);
  for (const Frame& frame : after.frames) EXPECT_DOUBLE_EQ(frame.camera(2, 0), 1.0);
}

}  // namespace
}  // namespace cohort::trajectory_model
