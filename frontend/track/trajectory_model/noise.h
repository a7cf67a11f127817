#pragma once

#include <Eigen/Core>
#include <cmath>

#include "frontend/track/trajectory_model/observation.h"

namespace cohort::trajectory_model {

// Residuals follow Student's t distribution in two dimensions with nu = 4 degrees of freedom. Twice
// its negative logarithm is (nu + 2) log(1 + s / nu) for a square s = d' information d. The
// derivative w.r.t. s is the weight of that square in a sum of squares: 1.5 at s = 0, 0.11 at seven
// deviations. (Lange, Little and Taylor 1989 take nu = 4 where the data do not determine it.)
inline constexpr double kStudentFreedom = 4.0;
inline double StudentWeight(double square) {
  return (kStudentFreedom + 2.0) / (kStudentFreedom + square);
}
inline double StudentCost(double square) {
  return (kStudentFreedom + 2.0) * std::log(1.0 + square / kStudentFreedom);
}

// The weight of a residual d in the sum of squares. `misfit` is the factor by which all the frame's
// squares exceed what their noise explains. An anchor has full weight: it defines the point.
inline Eigen::Matrix2d RobustInformation(const Observation& o,
                                         const Eigen::Vector2d& d,
                                         double misfit) {
  if (o.anchor) return o.information;
  return StudentWeight(d.dot(o.information * d) / misfit) * o.information;
}

}  // namespace cohort::trajectory_model
