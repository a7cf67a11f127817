#pragma once

#include <Eigen/Core>

namespace cohort::test {

// Central differences of f at x, entry by entry.
template <typename Function, typename Matrix>
Matrix NumericGradient(const Function& f, Matrix x, double step) {
  Matrix gradient = x;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    const double at = x(i);
    x(i) = at + step;
    const double after = f(x);
    x(i) = at - step;
    const double before = f(x);
    x(i) = at;
    gradient(i) = (after - before) / (2.0 * step);
  }
  return gradient;
}

}  // namespace cohort::test
