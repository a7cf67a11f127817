#include "frontend/core/statistics.h"

#include <gtest/gtest.h>

#include <limits>

namespace cohort {
namespace {

TEST(Statistics, MedianIsAValueOfTheListTheUpperOfTwo) {
  EXPECT_EQ(Median({3.0, 1.0, 2.0}), 2.0);
  EXPECT_EQ(Median({4.0, 1.0, 3.0, 2.0}), 3.0);
  EXPECT_EQ(Median({7.0}), 7.0);
  EXPECT_EQ(Median({}), 0.0);
}

TEST(Statistics, QuantileIsTheValueNearestToItsPlace) {
  const std::vector<double> values{50.0, 10.0, 40.0, 20.0, 30.0};
  EXPECT_EQ(Quantile(values, 0.0), 10.0);
  EXPECT_EQ(Quantile(values, 0.3), 20.0);  // place 1.2
  EXPECT_EQ(Quantile(values, 0.8), 40.0);  // place 3.2
  EXPECT_EQ(Quantile(values, 1.0), 50.0);
  EXPECT_EQ(Quantile({}, 0.8), 0.0);
}

// numpy.percentile([10, 20, 30, 40], [0, 25, 50, 90, 100])
TEST(Statistics, InterpolatedQuantileIsNumpysPercentile) {
  const std::vector<double> values{40.0, 10.0, 30.0, 20.0};
  EXPECT_EQ(InterpolatedQuantile(values, 0.0), 10.0);
  EXPECT_EQ(InterpolatedQuantile(values, 0.25), 17.5);
  EXPECT_EQ(InterpolatedMedian(values), 25.0);
  EXPECT_NEAR(InterpolatedQuantile(values, 0.9), 37.0, 1e-12);
  EXPECT_EQ(InterpolatedQuantile(values, 1.0), 40.0);
  EXPECT_EQ(InterpolatedMedian({}), 0.0);
}

TEST(Statistics, FailuresCountAsInfinite) {
  constexpr double kFailed = std::numeric_limits<double>::infinity();
  EXPECT_EQ(InterpolatedMedian({kFailed, 1.0, 2.0}), 2.0);
  EXPECT_EQ(InterpolatedMedian({kFailed, 1.0}), kFailed);
}

}  // namespace
}  // namespace cohort
