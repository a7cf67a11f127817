#include "pipelines/evaluation/trajectory_error.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>

#include "frontend/core/error.h"
#include "frontend/core/random_stream.h"
#include "frontend/storage/output.h"
#include "pipelines/evaluation/alignment.h"
#include "tests/support/shared_data.h"
#include "tests/support/source_dir.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

constexpr double kRelative = 1e-9;

void ExpectRelative(double value, double expected, const std::string& what) {
  EXPECT_NEAR(value, expected, kRelative * std::abs(expected)) << what;
}

void ExpectStatistics(const std::vector<double>& errors,
                      const nlohmann::json& expected,
                      const std::string& what) {
  const auto s = ComputeStatistics(errors);
  ASSERT_TRUE(s) << what;
  ExpectRelative(s->rmse, expected["rmse"], what + " rmse");
  ExpectRelative(s->mean, expected["mean"], what + " mean");
  ExpectRelative(s->median, expected["median"], what + " median");
  ExpectRelative(s->std, expected["std"], what + " std");
  ExpectRelative(s->min, expected["min"], what + " min");
  ExpectRelative(s->max, expected["max"], what + " max");
  ExpectRelative(s->sse, expected["sse"], what + " sse");
}

void ExpectAsEvo(const fs::path& folder, const std::string& name) {
  const auto expected = nlohmann::json::parse(std::ifstream(folder / "expected.json")).at(name);
  const auto estimate = ReadTumTrajectory(folder / (name + "_estimate.tum"));
  const auto truth = ReadTumTrajectory(folder / (name + "_truth.tum"));
  const auto pairs = AssociatePoses(estimate, truth);
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
    ExpectStatistics(AbsoluteTranslationErrors(aligned), values["ape_translation_m"], "APE");
    ExpectStatistics(AbsoluteRotationErrorsDeg(aligned), values["ape_rotation_deg"], "APE angle");
    for (const std::size_t delta : {1, 10}) {
      for (const auto& [name, kind] : {std::pair("consecutive", RelativePairs::kConsecutive),
                                       std::pair("all_pairs", RelativePairs::kAll)}) {
        const std::string suffix = "_delta" + std::to_string(delta) + "_" + name;
        const auto errors = ComputeRelativeErrors(aligned, delta, kind);
        ExpectStatistics(errors.translation, values["rpe_translation_m" + suffix], suffix);
        ExpectStatistics(errors.rotation_deg, values["rpe_rotation_deg" + suffix], suffix);
      }
    }
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
  for (const std::size_t delta : {1, 4}) {
    for (const auto kind : {RelativePairs::kConsecutive, RelativePairs::kAll}) {
      std::vector<double> translation, rotation;
      for (std::size_t i = 0; i < pairs.size(); ++i) {
        for (std::size_t j = 0; j < pairs.size(); ++j) {
          if (j != i + delta) continue;
          if (kind == RelativePairs::kConsecutive && i % delta != 0) continue;
          const Eigen::Matrix4d q = Matrix(pairs[i].truth).inverse() * Matrix(pairs[j].truth);
          const Eigen::Matrix4d p = Matrix(pairs[i].estimate).inverse() * Matrix(pairs[j].estimate);
          const Eigen::Matrix4d e = q.inverse() * p;
          translation.push_back(e.topRightCorner<3, 1>().norm());
          rotation.push_back(angle_deg(e));
        }
      }
      const auto errors = ComputeRelativeErrors(pairs, delta, kind);
      EXPECT_THAT(errors.translation, testing::Pointwise(testing::DoubleNear(1e-9), translation));
      EXPECT_THAT(errors.rotation_deg, testing::Pointwise(testing::DoubleNear(1e-6), rotation));
    }
  }
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

TEST(ComputeStatistics, OfFourNumbers) {
  const auto s = ComputeStatistics({4.0, 1.0, 3.0, 2.0});
  ASSERT_TRUE(s);
  EXPECT_EQ(s->count, 4u);
  EXPECT_DOUBLE_EQ(s->mean, 2.5);
  EXPECT_DOUBLE_EQ(s->median, 2.5);
  EXPECT_DOUBLE_EQ(s->sse, 30.0);
  EXPECT_DOUBLE_EQ(s->rmse, std::sqrt(7.5));
  EXPECT_DOUBLE_EQ(s->std, std::sqrt(1.25));
  EXPECT_DOUBLE_EQ(s->min, 1.0);
  EXPECT_DOUBLE_EQ(s->max, 4.0);
  EXPECT_FALSE(ComputeStatistics({}));
}

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

TEST(AssociatePoses, TakesTheNearestStampWithinTheLimit) {
  const auto at = [](double s, double x) {
    return StampedPose{static_cast<std::int64_t>(std::llround(s * 1e9)),
                       {Eigen::Quaterniond::Identity(), {x, 0.0, 0.0}}};
  };
  const std::vector truth{at(0.0, 0), at(0.033, 1), at(0.066, 2), at(0.1, 3)};
  const std::vector estimate{at(0.04, 10), at(0.062, 20), at(0.0881, 30)};
  const auto pairs = AssociatePoses(estimate, truth);
  ASSERT_EQ(pairs.size(), 2u);
  EXPECT_EQ(pairs[0].estimate.translation.x(), 10.0);
  EXPECT_EQ(pairs[0].truth.translation.x(), 1.0);
  EXPECT_EQ(pairs[1].truth.translation.x(), 2.0);
  // A longer estimate is searched from the truth's side.
  const auto swapped = AssociatePoses(truth, estimate);
  ASSERT_EQ(swapped.size(), 2u);
  EXPECT_EQ(swapped[0].truth.translation.x(), 10.0);
  // Of stamps equally near the first of the file, which need not be in order.
  const std::vector shuffled{at(0.5, 0), at(0.1, 1), at(0.2, 2), at(0.1, 3), at(0.2, 4)};
  const auto nearest = AssociatePoses(
      std::vector{at(0.1, 10), at(0.15, 20), at(0.21, 30), at(0.5, 40)}, shuffled, 60'000'000);
  ASSERT_EQ(nearest.size(), 4u);
  EXPECT_EQ(nearest[0].truth.translation.x(), 1.0);
  EXPECT_EQ(nearest[1].truth.translation.x(), 1.0);
  EXPECT_EQ(nearest[2].truth.translation.x(), 2.0);
  EXPECT_EQ(nearest[3].truth.translation.x(), 0.0);
  EXPECT_TRUE(AssociatePoses({}, truth).empty());
  EXPECT_EQ(AssociatePoses(estimate, truth, 20'000'000).size(), 3u);
}

TEST(ReadTumTrajectory, NamesTheLineThatIsNoPose) {
  const test::TempDir dir;
  const std::string good = "# t tx ty tz qx qy qz qw\n1.5 1 2 3 0 0 0 2\n";
  WriteBytes(dir / "a.tum", good);
  const auto poses = ReadTumTrajectory(dir / "a.tum");
  ASSERT_EQ(poses.size(), 1u);
  EXPECT_EQ(poses[0].timestamp_ns, 1'500'000'000);
  EXPECT_EQ(poses[0].world_from_cam.translation, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(poses[0].world_from_cam.rotation.w(), 1.0);
  for (const std::string bad : {"2 1 2 3 0 0 0\n",
                                "2 1 2 nan 0 0 0 1\n",
                                "2 1 2 3 0 0 0 0\n",
                                "2 1 2 3 0 1e200 1e200 1\n"}) {
    WriteBytes(dir / "a.tum", good + bad);
    EXPECT_THAT([&] { ReadTumTrajectory(dir / "a.tum"); },
                testing::ThrowsMessage<Error>(
                    testing::AllOf(testing::HasSubstr("a.tum"), testing::HasSubstr("3"))));
  }
}

}  // namespace
}  // namespace cohort
