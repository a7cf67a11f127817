#include "frontend/track/measure/there_and_back.h"

#include <optional>

#include "frontend/core/in_parallel.h"
#include "frontend/core/part_times.h"
#include "frontend/energy/patch_energy.h"
#include "frontend/track/measure/measurement.h"

namespace cohort {
namespace {

// The wider of the windows that KLT is compared with: on four levels it reaches 120 px.
constexpr int kWindowPx = 31;
constexpr double kReturnPx = 1.0;
constexpr double kElsewherePx = 3.0;

// Where Lucas-Kanade finds the window around `xy` of the previous picture, if the way back ends
// where it began.
std::optional<Eigen::Vector2d> ThereAndBack(const Pyramid& previous,
                                            const Pyramid& current,
                                            const Eigen::Vector2d& xy) {
  auto there = TrackWindow(previous, current, xy, kWindowPx);
  if (!there) return std::nullopt;
  const auto back = TrackWindow(current, previous, *there, kWindowPx);
  if (!back || (*back - xy).norm() > kReturnPx) return std::nullopt;
  return there;
}

}  // namespace

Eigen::Matrix2Xd BetterStarts(const Pyramid& previous,
                              const Pyramid& current,
                              const Eigen::Matrix2Xd& x_previous,
                              const Eigen::Matrix2Xd& guided,
                              std::span<const std::size_t> which,
                              std::span<const Feature> features,
                              int n) {
  const TimedPart part("there and back");
  Eigen::Matrix2Xd starts = guided;
  ForEachInParallel(which.size(), [&](std::size_t i) {
    const auto f = static_cast<Eigen::Index>(which[i]);
    const auto found = ThereAndBack(previous, current, x_previous.col(f));
    if (!found || (*found - guided.col(f)).norm() <= kElsewherePx) return;
    const auto unlike = [&](const Eigen::Vector2d& xy) {
      return PatchEnergy(current.levels[0], xy, features[which[i]].templates[0], n);
    };
    if (unlike(*found) < unlike(guided.col(f))) starts.col(f) = *found;
  });
  return starts;
}

}  // namespace cohort
