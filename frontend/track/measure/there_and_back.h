#pragma once

#include <Eigen/Core>
#include <span>

#include "frontend/image/pyramid.h"
#include "frontend/track/measure/feature.h"

namespace cohort {

// Where a measurement starts: at the joint guide's position, or where Lucas-Kanade with a
// forward-backward check, as in a plain tracker, finds the feature instead, if that differs and
// looks more like the template. Lucas-Kanade reaches further than the guide and costs more, so only
// the features `which` are tried: those that are not seen at the guide's position, or all if the
// camera is too fast for the guide. docs/results/worth.md says what it is worth.
//
// `x_previous`, `guided`: 2 x F, positions in the two pictures; the result is like `guided`. `n`:
// side of the templates.
Eigen::Matrix2Xd BetterStarts(const Pyramid& previous,
                              const Pyramid& current,
                              const Eigen::Matrix2Xd& x_previous,
                              const Eigen::Matrix2Xd& guided,
                              std::span<const std::size_t> which,
                              std::span<const Feature> features,
                              int n);

}  // namespace cohort
