#include "pipelines/evaluation/alignment.h"

#include <gmock/gmock.h>
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
        target_columns.col(i) = target.back();
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

// Places along a line, with `error` added to their distance from its beginning.
Points OnALine(const Eigen::Vector3d& direction, double step, const std::vector<double>& error) {
  Points line;
  for (std::size_t i = 0; i < error.size(); ++i) {
    const double at = step * static_cast<double>(i) + error[i];
    line.push_back(Eigen::Vector3d(1, 2, 3) + at * direction.normalized());
  }
  return line;
}

TEST(AlignPoints, IsNotFixedByFewOrCollinearPoints) {
  const Points two = RandomPoints(2, 1);
  EXPECT_EQ(FitAlignment(two, two, AlignmentScale::kEstimated).status,
            AlignmentStatus::kTooFewPoints);
  EXPECT_FALSE(AlignedRmse(two, two));
  const Points all = RandomPoints(10, 1);
  const Points line = OnALine({0.3, -0.2, 0.7}, 0.1, std::vector<double>(10, 0.0));
  const Points one_place(10, Eigen::Vector3d(0.1, 0.7, 1e3));
  for (const bool swapped : {false, true}) {
    const auto status = [&](const Points& a, const Points& b) {
      const Alignment alignment = swapped ? FitAlignment(b, a, AlignmentScale::kEstimated)
                                          : FitAlignment(a, b, AlignmentScale::kEstimated);
      return alignment.status;
    };
    EXPECT_EQ(status(line, all), AlignmentStatus::kFreeAboutALine);
    EXPECT_EQ(status(one_place, all), AlignmentStatus::kOnePlace);
    EXPECT_EQ(status(one_place, one_place), AlignmentStatus::kOnePlace);
    EXPECT_EQ(status(one_place, line), AlignmentStatus::kOnePlace);
  }
  EXPECT_FALSE(AlignPoints(line, all, AlignmentScale::kEstimated));
  EXPECT_FALSE(AlignedRmse(all, one_place));
  EXPECT_THAT(Reason(AlignmentStatus::kOnePlace), testing::HasSubstr("one position"));
  Points bent = line;
  bent.back() += Eigen::Vector3d(0.0, 1e-3, 0.0);
  EXPECT_TRUE(AlignPoints(bent, bent, AlignmentScale::kEstimated));
}

// On two lines the alignment is a regression of one distance on the other: the mean square residual
// is var(target) (1 - r^2), the scale r sd(target) / sd(source).
TEST(AlignPoints, OnALineDistancesAreThoseOfALinearRegression) {
  const std::vector<double> noise{0.1, -0.3, 0.2, 0.05, -0.15, 0.4, -0.2, 0.0, 0.1, -0.2};
  const Points source = OnALine({0.3, -0.2, 0.7}, 0.5, std::vector<double>(noise.size(), 0.0));
  const Points target = OnALine({-1.0, 0.4, 0.1}, 1.5, noise);
  const double n = static_cast<double>(noise.size());
  double x_mean = 0.0, y_mean = 0.0, xx = 0.0, yy = 0.0, xy = 0.0;
  for (std::size_t i = 0; i < noise.size(); ++i) {
    x_mean += 0.5 * static_cast<double>(i) / n;
    y_mean += (1.5 * static_cast<double>(i) + noise[i]) / n;
  }
  for (std::size_t i = 0; i < noise.size(); ++i) {
    const double x = 0.5 * static_cast<double>(i) - x_mean;
    const double y = 1.5 * static_cast<double>(i) + noise[i] - y_mean;
    xx += x * x / n;
    yy += y * y / n;
    xy += x * y / n;
  }
  const Alignment alignment = FitAlignment(source, target, AlignmentScale::kEstimated);
  EXPECT_EQ(alignment.status, AlignmentStatus::kFreeAboutALine);
  EXPECT_NEAR(alignment.target_from_source.scale, xy / xx, 1e-12);
  EXPECT_NEAR(*AlignedRmse(source, target), std::sqrt(yy - xy * xy / xx), 1e-12);

  // Bent by a trifle the alignment is unique, which is what evo asks for, and the figure is the
  // same.
  Points bent_source = source;
  Points bent_target = target;
  bent_source[4] += Eigen::Vector3d(0.0, 1e-5, 1e-5);
  bent_target[4] += Eigen::Vector3d(0.0, 1e-5, 0.0);
  EXPECT_TRUE(AlignPoints(bent_source, bent_target, AlignmentScale::kEstimated));
  EXPECT_NEAR(*AlignedRmse(bent_source, bent_target), *AlignedRmse(source, target), 1e-5);
}

// A path on a line, and an estimate that strays from it: every turn about the line is as good.
TEST(AlignPoints, AroundALineDistancesDoNotDependOnTheTurn) {
  const std::vector<double> even(12, 0.0);
  const Points target = OnALine({0.1, 0.2, 1.0}, 0.3, even);
  Points source = RandomPoints(even.size(), 3);
  for (std::size_t i = 0; i < source.size(); ++i) source[i] = 0.02 * source[i] + target[i];
  const Alignment alignment = FitAlignment(source, target, AlignmentScale::kEstimated);
  ASSERT_EQ(alignment.status, AlignmentStatus::kFreeAboutALine);
  const double least = Cost(alignment.target_from_source, source, target);
  const Eigen::Vector3d axis = Eigen::Vector3d(0.1, 0.2, 1.0).normalized();
  for (const double angle : {0.5, 2.0, -1.3}) {
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(angle, axis));
    Sim3 turned = alignment.target_from_source;
    turned.rotation = turn * turned.rotation;
    turned.translation = target[0] + turn * (turned.translation - target[0]);
    EXPECT_NEAR(Cost(turned, source, target), least, 1e-12);
  }
  EXPECT_NEAR(*AlignedRmse(source, target), std::sqrt(least / 12.0), 1e-12);
}

}  // namespace
}  // namespace cohort
