#include "frontend/track/subspace/line_search.h"

#include <gtest/gtest.h>

#include <cmath>

namespace cohort {
namespace {

TEST(NearestMinimum, OfAParabolaIsExact) {
  const auto f = [](double d) { return 3.0 * (d - 0.7) * (d - 0.7) + 2.0; };
  for (const double first_step : {0.1, 0.5, 1.0}) {
    const LineSearchResult result = NearestMinimum(f, f(0.0), first_step, 10.0);
    EXPECT_NEAR(result.d, 0.7, 1e-12) << "first step " << first_step;
    EXPECT_NEAR(result.value, 2.0, 1e-12);
  }
}

TEST(NearestMinimum, CutsAFirstStepThatIsTooLong) {
  const auto f = [](double d) { return (d - 0.01) * (d - 0.01); };
  const LineSearchResult result = NearestMinimum(f, f(0.0), 1.0, 10.0);
  EXPECT_NEAR(result.d, 0.01, 1e-12);
}

TEST(NearestMinimum, StopsAtTheNearerOfTwoMinima) {
  // Minima at about 1 and, deeper, at about 5; the steps 0.3, 0.6, 1.2, 2.4 do not jump the hill.
  const auto f = [](double d) { return std::cos(M_PI * (d - 1.0) / 2.0 + M_PI) - 0.05 * d; };
  const LineSearchResult result = NearestMinimum(f, f(0.0), 0.3, 10.0);
  EXPECT_NEAR(result.d, 1.0, 0.1);
}

TEST(NearestMinimum, OfWhatFallsAllTheWayIsTheEnd) {
  const auto f = [](double d) { return -d; };
  const LineSearchResult result = NearestMinimum(f, 0.0, 0.5, 3.0);
  EXPECT_EQ(result.d, 3.0);
  EXPECT_EQ(result.value, -3.0);
}

TEST(NearestMinimum, GoesNoFurtherThanTheLongestStepEvenAtFirst) {
  const auto f = [](double d) { return -d; };
  EXPECT_EQ(NearestMinimum(f, 0.0, 5.0, 3.0).d, 3.0);
}

TEST(NearestMinimum, StaysWhereNothingIsLower) {
  const auto f = [](double d) { return d; };
  const LineSearchResult result = NearestMinimum(f, 0.0, 1.0, 10.0, 4);
  EXPECT_EQ(result.d, 0.0);
  EXPECT_EQ(result.value, 0.0);
  EXPECT_EQ(result.evaluations, 1 + 4);  // the first step, and four cuts
}

TEST(NearestMinimum, CountsItsEvaluations) {
  int calls = 0;
  const auto f = [&](double d) {
    ++calls;
    return std::abs(d - 1.3);
  };
  const LineSearchResult result = NearestMinimum(f, 1.3, 0.1, 10.0);
  EXPECT_EQ(result.evaluations, calls);
  EXPECT_LT(result.value, 0.5);
}

}  // namespace
}  // namespace cohort
