#pragma once

#include <algorithm>
#include <cmath>

namespace cohort {

struct LineSearchResult {
  double d = 0.0;      // 0 if no smaller value was found
  double value = 0.0;  // f(d)
  int evaluations = 0;
};

// The nearest local minimum of f on d > 0, starting downhill from 0 (paper 3.3: "a fast line
// search"). Steps double from `first_step` until f rises. If f rises at the first step already,
// that step is divided by 4, at most `max_cuts` times. One parabola through the three bracketing
// points ends the search.
template <typename Function>
LineSearchResult NearestMinimum(
    const Function& f, double f0, double first_step, double max_step, int max_cuts = 6) {
  LineSearchResult best{0.0, f0, 0};
  double d = std::min(first_step, max_step);
  double fd = f(d);
  ++best.evaluations;
  for (int cut = 0; fd >= f0 && cut < max_cuts; ++cut) {
    d *= 0.25;
    fd = f(d);
    ++best.evaluations;
  }
  if (fd >= f0) return best;
  double before = 0.0;
  double f_before = f0;
  double after = d;
  double f_after = fd;
  while (d < max_step) {
    after = std::min(2.0 * d, max_step);
    f_after = f(after);
    ++best.evaluations;
    if (f_after >= fd) break;
    before = d;
    f_before = fd;
    d = after;
    fd = f_after;
  }
  best.d = d;
  best.value = fd;
  if (after <= d) return best;  // still falling at max_step
  // The parabola's top is inside (before, after), as f(d) is below both.
  const double left = d - before;
  const double right = after - d;
  const double a = (f_before - fd) / left;
  const double b = (f_after - fd) / right;
  if (a + b <= 0.0) return best;
  const double top = d + 0.5 * (a * right - b * left) / (a + b);
  if (std::abs(top - d) < 1e-3 * (after - before)) return best;
  const double f_top = f(top);
  ++best.evaluations;
  if (f_top < best.value) {
    best.d = top;
    best.value = f_top;
  }
  return best;
}

}  // namespace cohort
