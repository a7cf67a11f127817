#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <utility>
#include <vector>

// Order statistics. Lists are passed by value, because they are reordered; an empty one gives 0.
namespace cohort {

// The value of the list at position round(share * (n - 1)) in sorted order: for choosing scales and
// bounds. At 0.5 of an even number it is the upper of the two in the middle.
inline double Quantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const double place = share * static_cast<double>(values.size() - 1);
  // NOLINTNEXTLINE(bugprone-incorrect-roundings): not negative
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(place + 0.5);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// The median of chi-square with two degrees of freedom, that of a squared whitened residual.
inline constexpr double kMedianChiSquare2 = 2.0 * std::numbers::ln2;

inline double Median(std::vector<double> values) { return Quantile(std::move(values), 0.5); }

// Interpolates linearly between neighbours, as numpy's percentile: for figures that are reported.
inline double InterpolatedQuantile(std::vector<double> values, double share) {
  if (values.empty()) return 0.0;
  const double place = share * static_cast<double>(values.size() - 1);
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(place);
  std::nth_element(values.begin(), at, values.end());
  const double lower = *at;
  const double beyond = place - std::floor(place);
  if (beyond == 0.0) return lower;  // the next one may be infinite
  return std::lerp(lower, *std::min_element(at + 1, values.end()), beyond);
}

inline double InterpolatedMedian(std::vector<double> values) {
  return InterpolatedQuantile(std::move(values), 0.5);
}

}  // namespace cohort
