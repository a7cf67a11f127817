#include "pipelines/evaluation/alignment.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <vector>

#include "frontend/core/random_stream.h"

namespace cohort {
namespace {

using Points = std::vector<Eigen::Vector3d>;

Points RandomPoints(std::size_t n, std::uint64_t seed) {
  RandomStream random(seed, "alignment_test/points");
  Points points(n);
  for (auto& p : points) p = {random.Gaussian(), 2.0 * random.Gaussian(), 0.3 * random.Gaussian()};
  return points;
}

Sim3 RandomSim3(std::uint64_t seed) {
  RandomStream random(seed, "alignment_test/sim3");
  Sim3 sim;
  sim.scale = random.Uniform(0.1, 10.0);
  sim.rotation =
      Eigen::Quaterniond(random.Gaussian(), random.Gaussian(), random.Gaussian(), random.Gaussian())
          .normalized();
  sim.translation = {random.Gaussian(), random.Gaussian(), random.Gaussian()};
  return sim;
}

double Cost(const Sim3& sim, const Points& source, const Points& target) {
  double cost = 0.0;
  for (std::size_t i = 0; i < source.size(); ++i)
    cost += (target[i] - sim * source[i]).squaredNorm();
  return cost;
}

TEST(AlignPoints, RecoversASimilarity) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Sim3 truth = RandomSim3(seed);
    const Points source = RandomPoints(3 + seed, seed);
    Points target;
    for (const auto& p : source) target.push_back(truth * p);
    const auto sim = AlignPoints(source, target, AlignmentScale::kEstimated);
    ASSERT_TRUE(sim);
    EXPECT_NEAR(sim->scale, truth.scale, 1e-12 * truth.scale);
    EXPECT_LT(AngleBetween(sim->rotation, truth.rotation), 1e-12);
    EXPECT_LT((sim->translation - truth.translation).norm(), 1e-11);
  }
}

TEST(AlignPoints, AgreesWithEigenOnNoisyAndMirroredPoints) {
  for (const double mirror : {1.0, -1.0}) {
    for (const auto scale : {AlignmentScale::kEstimated, AlignmentScale::kOne}) {
      const Points source = RandomPoints(30, 1);
      const Points noise = RandomPoints(30, 2);
      Points target;
      Eigen::Matrix3Xd source_columns(3, 30), target_columns(3, 30);
      for (int i = 0; i < 30; ++i) {
        const Eigen::Vector3d p = source[i].cwiseProduct(Eigen::Vector3d(1, 1, mirror));
        target.push_back(RandomSim3(3) * p + 0.1 * noise[i]);
        source_columns.col(i) = source[i];
        target_columns.col(i) = target[i];
      }
      const Eigen::Matrix4d expected =
          Eigen::umeyama(source_columns, target_columns, scale == AlignmentScale::kEstimated);
      const auto sim = AlignPoints(source, target, scale);
      ASSERT_TRUE(sim);
      const Eigen::Matrix3d linear = sim->scale * sim->rotation.toRotationMatrix();
      EXPECT_LT((linear - expected.topLeftCorner<3, 3>()).norm(), 1e-11);
      EXPECT_LT((sim->translation - expected.topRightCorner<3, 1>()).norm(), 1e-11);
    }
  }
}

TEST(AlignPoints, NoNearbySimilarityIsBetter) {
  const Points source = RandomPoints(12, 5);
  const Points target = RandomPoints(12, 6);
  const auto best = AlignPoints(source, target, AlignmentScale::kEstimated);
  ASSERT_TRUE(best);
  const double least = Cost(*best, source, target);
  RandomStream random(7, "alignment_test/perturb");
  for (int i = 0; i < 2000; ++i) {
    const double step = std::pow(10.0, random.Uniform(-5.0, -1.0));
    Sim3 other = *best;
    other.scale *= 1.0 + step * random.Gaussian();
    const Eigen::Vector3d turn(random.Gaussian(), random.Gaussian(), random.Gaussian());
    other.rotation = Eigen::Quaterniond(Eigen::AngleAxisd(step * turn.norm(), turn.normalized())) *
                     other.rotation;
    for (int k = 0; k < 3; ++k) other.translation[k] += step * random.Gaussian();
    EXPECT_GE(Cost(other, source, target), least);
  }
}

TEST(AlignPoints, IsNotFixedByFewOrCollinearPoints) {
  const Points two = RandomPoints(2, 1);
  EXPECT_FALSE(AlignPoints(two, two, AlignmentScale::kEstimated));
  const Points all = RandomPoints(10, 1);
  Points line, one_place;
  for (int i = 0; i < 10; ++i) {
    line.push_back(Eigen::Vector3d(1, 2, 3) + 0.1 * i * Eigen::Vector3d(0.3, -0.2, 0.7));
    one_place.push_back({1, 2, 3});
  }
  for (const Points& degenerate : {line, one_place}) {
    EXPECT_FALSE(AlignPoints(degenerate, all, AlignmentScale::kEstimated));
    EXPECT_FALSE(AlignPoints(all, degenerate, AlignmentScale::kEstimated));
  }
  Points bent = line;
  bent.back() += Eigen::Vector3d(0.0, 1e-3, 0.0);
  EXPECT_TRUE(AlignPoints(bent, bent, AlignmentScale::kEstimated));
}

}  // namespace
}  // namespace cohort
