#include "frontend/track/measure/there_and_back.h"

#include <cmath>

#include "frontend/core/in_parallel.h"
#include "frontend/core/part_times.h"
#include "frontend/energy/patch_energy.h"
#include "frontend/track/measure/measurement.h"

namespace cohort {
namespace {

// The wider of the windows that KLT is compared with: on four levels it reaches 120 px.
constexpr int kWindowPx = 31;
constexpr double kReturnPx = 1.0;

}  // namespace

void ThereAndBack::Track(const Pyramid& current,
                         const Eigen::Matrix2Xd& newest,
                         std::span<const std::size_t> which,
                         std::span<Feature> features) {
  const TimedPart part("there and back");
  ForEachInParallel(which.size(), [&](std::size_t i) {
    const Eigen::Vector2d xy = newest.col(static_cast<Eigen::Index>(which[i]));
    auto& returned_xy = features[which[i]].returned_xy;
    returned_xy = TrackWindow(previous_, current, xy, kWindowPx);
    if (!returned_xy) return;
    const auto back = TrackWindow(current, previous_, *returned_xy, kWindowPx);
    if (!back || (*back - xy).norm() > kReturnPx) returned_xy.reset();
  });
}

Eigen::Matrix2Xd ThereAndBack::BetterStarts(const Pyramid& current,
                                            const Eigen::Matrix2Xd& guide,
                                            std::span<const Feature> features,
                                            int n) {
  const TimedPart part("there and back");
  constexpr double kElsewherePx = 3.0;
  Eigen::Matrix2Xd starts = guide;
  for (std::size_t f = 0; f < features.size(); ++f) {
    const auto& returned = features[f].returned_xy;
    auto start = starts.col(static_cast<Eigen::Index>(f));
    if (!returned || (*returned - start).norm() <= kElsewherePx) continue;
    const auto unlike = [&](const Eigen::Vector2d& xy) {
      return PatchEnergy(current.levels[0], xy, features[f].templates[0], n);
    };
    if (unlike(*returned) < unlike(start)) start = *returned;
  }
  return starts;
}

bool ThereAndBack::IsOpen(const TrajectoryModel::Estimate& predicted) const {
  return max_open_px_ > 0.0 &&
         std::sqrt(0.5 * predicted.measured_covariance.trace()) > max_open_px_;
}

}  // namespace cohort
