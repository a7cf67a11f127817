#include "frontend/track/there_and_back.h"

#include <cmath>
#include <utility>

#include "frontend/core/part_times.h"
#include "frontend/energy/patch_energy.h"
#include "frontend/track/lucas_kanade.h"

namespace cohort {
namespace {

// The wider of the windows that KLT is compared with: on four levels it reaches 120 px.
constexpr int kWindowPx = 31;
constexpr int kMaxLevel = 3;
constexpr double kReturnPx = 1.0;

}  // namespace

void ThereAndBack::Remember(const Pyramid& picture) {
  previous_ = picture;
  lk_previous_ = std::exchange(lk_current_, {});
}

void ThereAndBack::Track(const Pyramid& current,
                         const Eigen::Matrix2Xd& newest,
                         std::span<const std::size_t> which,
                         std::span<Feature> features) {
  if (which.empty()) return;
  const TimedPart part("there and back");
  if (lk_previous_.empty()) lk_previous_ = LkPyramid(previous_, kWindowPx, kMaxLevel);
  if (lk_current_.empty()) lk_current_ = LkPyramid(current, kWindowPx, kMaxLevel);
  std::vector<cv::Point2f> starts;
  for (const std::size_t f : which) {
    const Eigen::Vector2f xy = newest.col(static_cast<Eigen::Index>(f)).cast<float>();
    starts.emplace_back(xy.x(), xy.y());
  }
  const LkResult returned =
      TrackThereAndBack(lk_previous_, lk_current_, starts, kWindowPx, kMaxLevel, kReturnPx);
  for (std::size_t i = 0; i < which.size(); ++i) {
    auto& returned_xy = features[which[i]].returned_xy;
    returned_xy.reset();
    if (returned.found[i] != 0) returned_xy = {returned.ends[i].x, returned.ends[i].y};
  }
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
