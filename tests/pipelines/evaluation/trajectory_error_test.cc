#include "pipelines/evaluation/trajectory_error.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>

#include "frontend/core/random_stream.h"
#include "pipelines/evaluation/alignment.h"
#include "tests/support/shared_data.h"
#include "tests/support/source_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

constexpr double kRelative = 1e-9;

void ExpectRelative(double value, double expected, const std::string& what) {
  EXPECT_NEAR(value, expected, kRelative * std::abs(expected)) << what;
}

// t tx ty tz qx qy qz qw, world_from_cam, by time [s].
std::map<double, Rigid3> ReadTum(const fs::path& path) {
  std::map<double, Rigid3> poses;
  std::ifstream in(path);
  double t = 0.0;
  Rigid3 pose;
  Eigen::Vector3d& p = pose.translation;
  Eigen::Vector4d q;
  while (in >> t >> p.x() >> p.y() >> p.z() >> q.x() >> q.y() >> q.z() >> q.w()) {
    pose.rotation = Eigen::Quaterniond(q).normalized();
    poses[t] = pose;
  }
  return poses;
}

// As evo does with an estimate that is not longer than the truth: each of its poses with the one
// nearest in time, if that is within 10 ms.
std::vector<PosePair> Associate(const std::map<double, Rigid3>& estimate,
                                const std::map<double, Rigid3>& truth) {
  std::vector<PosePair> pairs;
  for (const auto& [t, pose] : estimate) {
    const auto nearest = std::ranges::min_element(
        truth, {}, [t = t](const auto& other) { return std::abs(other.first - t); });
    if (std::abs(nearest->first - t) <= 0.01) pairs.push_back({pose, nearest->second});
  }
  return pairs;
}

void ExpectAsEvo(const fs::path& folder, const std::string& name) {
  const auto expected = nlohmann::json::parse(std::ifstream(folder / "expected.json")).at(name);
  const auto pairs = Associate(ReadTum(folder / (name + "_estimate.tum")),
                               ReadTum(folder / (name + "_truth.tum")));
  ASSERT_EQ(pairs.size(), expected["associated"].get<std::size_t>());
  std::vector<Eigen::Vector3d> estimated_centres, true_centres;
  for (const PosePair& pair : pairs) {
    estimated_centres.push_back(pair.estimate.translation);
    true_centres.push_back(pair.truth.translation);
  }
  for (const auto& [key, scale] :
       {std::pair("se3", AlignmentScale::kOne), std::pair("sim3", AlignmentScale::kEstimated)}) {
    const auto& values = expected[key];
    const auto sim = AlignPoints(estimated_centres, true_centres, scale);
    ASSERT_TRUE(sim);
    ExpectRelative(sim->scale, values["scale"], "scale");
    for (int r = 0; r < 3; ++r) {
      EXPECT_NEAR(sim->translation[r], values["translation"][r].get<double>(), 1e-9);
      for (int c = 0; c < 3; ++c) {
        EXPECT_NEAR(
            sim->rotation.toRotationMatrix()(r, c), values["rotation"][r][c].get<double>(), 1e-9);
      }
    }
    const auto aligned = TransformEstimates(*sim, pairs);
    ExpectRelative(
        Rmse(AbsoluteTranslationErrors(aligned)), values["ape_translation_m"]["rmse"], "APE");
    const auto errors = ComputeRelativeErrors(aligned);
    ExpectRelative(
        Rmse(errors.translation), values["rpe_translation_m_delta1_all_pairs"]["rmse"], "RPE");
    ExpectRelative(Rmse(errors.rotation_deg),
                   values["rpe_rotation_deg_delta1_all_pairs"]["rmse"],
                   "RPE angle");
  }
}

TEST(TrajectoryError, EqualsEvoOnTheSyntheticPath) {
  ExpectAsEvo(test::SourceDir() / "tests/data/evo", "synthetic");
}

TEST(TrajectoryError, EqualsEvoOnARealPath) {
  const char* const folder = std::getenv("COHORT_GOLDEN");
  const fs::path golden = folder != nullptr ? fs::path(folder) : test::SharedData("../golden");
  COHORT_SKIP_WITHOUT(golden / "evo/real_truth.tum");
  ExpectAsEvo(golden / "evo", "real");
}

std::vector<PosePair> RandomPairs(std::size_t n) {
  RandomStream random(4, "trajectory_error_test");
  const auto pose = [&] {
    return Rigid3{Eigen::Quaterniond(
                      random.Gaussian(), random.Gaussian(), random.Gaussian(), random.Gaussian())
                      .normalized(),
                  {random.Gaussian(), random.Gaussian(), random.Gaussian()}};
  };
  std::vector<PosePair> pairs(n);
  for (PosePair& pair : pairs) pair = {pose(), pose()};
  return pairs;
}

Eigen::Matrix4d Matrix(const Rigid3& rigid) {
  Eigen::Matrix4d m = Eigen::Matrix4d::Identity();
  m.topLeftCorner<3, 3>() = rigid.rotation.toRotationMatrix();
  m.topRightCorner<3, 1>() = rigid.translation;
  return m;
}

// Every definition once more, on 4x4 matrices and traces.
TEST(TrajectoryError, EqualsABruteForceComputation) {
  const auto pairs = RandomPairs(23);
  const auto angle_deg = [](const Eigen::Matrix4d& m) {
    return std::acos((m.topLeftCorner<3, 3>().trace() - 1.0) / 2.0) * 180.0 / std::numbers::pi;
  };
  std::vector<double> translation, rotation;
  for (std::size_t i = 0; i + 1 < pairs.size(); ++i) {
    const Eigen::Matrix4d q = Matrix(pairs[i].truth).inverse() * Matrix(pairs[i + 1].truth);
    const Eigen::Matrix4d p = Matrix(pairs[i].estimate).inverse() * Matrix(pairs[i + 1].estimate);
    const Eigen::Matrix4d e = q.inverse() * p;
    translation.push_back(e.topRightCorner<3, 1>().norm());
    rotation.push_back(angle_deg(e));
  }
  const auto errors = ComputeRelativeErrors(pairs);
  EXPECT_THAT(errors.translation, testing::Pointwise(testing::DoubleNear(1e-9), translation));
  EXPECT_THAT(errors.rotation_deg, testing::Pointwise(testing::DoubleNear(1e-6), rotation));
  const auto pose_errors = RelativePoseErrorsDeg(pairs, 0.0);
  std::size_t k = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    for (std::size_t j = i + 1; j < pairs.size(); ++j, ++k) {
      const Eigen::Matrix4d q = Matrix(pairs[i].truth).inverse() * Matrix(pairs[j].truth);
      const Eigen::Matrix4d p = Matrix(pairs[i].estimate).inverse() * Matrix(pairs[j].estimate);
      const Eigen::Vector3d a = p.topRightCorner<3, 1>().normalized();
      const Eigen::Vector3d b = q.topRightCorner<3, 1>().normalized();
      const double direction_deg = std::acos(a.dot(b)) * 180.0 / std::numbers::pi;
      EXPECT_NEAR(pose_errors[k], std::max(angle_deg(q.inverse() * p), direction_deg), 1e-6);
    }
  }
  EXPECT_EQ(k, pose_errors.size());
}

TEST(Rmse, OfFourNumbers) { EXPECT_DOUBLE_EQ(Rmse({4.0, 1.0, 3.0, 2.0}), std::sqrt(7.5)); }

TEST(AreaUnderRecall, IsExactBetweenTheErrors) {
  const std::vector<double> errors{2.5, 0.5};
  EXPECT_NEAR(AreaUnderRecall(errors, 3.0, 2), 0.7083333333333333, 1e-15);
  const double never = std::numeric_limits<double>::infinity();
  EXPECT_NEAR(AreaUnderRecall({0.0, 0.0}, 5.0, 4), 0.5, 1e-15);
  EXPECT_EQ(AreaUnderRecall({never, 5.0}, 5.0, 2), 0.0);
}

TEST(RelativePoseErrors, TakeNoDirectionFromCamerasThatDoNotMove) {
  PosePair a, b;
  b.truth.translation = {0.0, 0.0, 1e-4};
  b.estimate.translation = {1.0, 0.0, 0.0};
  EXPECT_THAT(RelativePoseErrorsDeg(std::vector{a, b}, 1e-3), testing::ElementsAre(0.0));
  EXPECT_THAT(RelativePoseErrorsDeg(std::vector{a, b}, 0.0),
              testing::ElementsAre(testing::DoubleNear(90.0, 1e-9)));
  b.estimate.translation.setZero();
  EXPECT_THAT(RelativePoseErrorsDeg(std::vector{a, b}, 0.0), testing::ElementsAre(180.0));
}

}  // namespace
}  // namespace cohort
