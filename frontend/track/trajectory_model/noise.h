#pragma once

#include <Eigen/Core>
#include <cmath>

#include "frontend/track/trajectory_model/observation.h"

namespace cohort::trajectory_model {

// Residuals are of Student's t in two dimensions with nu = 4 degrees of freedom, whose negative
// logarithm, twice, is (nu + 2) log(1 + s / nu) for a square s = d' information d. Its derivative
// by s is the weight of that square in a sum of squares: 1.5 for none, 0.11 at seven deviations.
// (Lange, Little and Taylor 1989, who take nu = 4 where the data do not tell.)
inline constexpr double kStudentFreedom = 4.0;
inline double StudentWeight(double square) {
  return (kStudentFreedom + 2.0) / (kStudentFreedom + square);
}
inline double StudentCost(double square) {
  return (kStudentFreedom + 2.0) * std::log(1.0 + square / kStudentFreedom);
}

// Of chi-square with two degrees of freedom: 2 log 2.
inline constexpr double kMedianChiSquare = 1.386;

// How much a residual d counts in the sum of squares. `misfit` is by how much all the frame's
// squares exceed what their noise explains. An anchor is never in doubt: it defines the point.
inline Eigen::Matrix2d RobustInformation(const Observation& o,
                                         const Eigen::Vector2d& d,
                                         double misfit) {
  if (o.anchor) return o.information;
  return StudentWeight(d.dot(o.information * d) / misfit) * o.information;
}

}  // namespace cohort::trajectory_model
