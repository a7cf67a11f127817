#include "frontend/track/there_and_back.h"

#include <cmath>
#include <utility>

#include "frontend/energy/patch_energy.h"
#include "frontend/track/lucas_kanade.h"

namespace cohort {
namespace {

// The wider of the windows that KLT is compared with: on four levels it reaches 120 px.
constexpr int kWindowPx = 31;
constexpr int kMaxLevel = 3;
constexpr double kReturnPx = 1.0;

}  // namespace

void ThereAndBack::Begin(const Pyramid& picture) {
  previous_ = LkPyramid(picture, kWindowPx, kMaxLevel);
}

void ThereAndBack::Track(const Pyramid& current,
                         const Eigen::Matrix2Xd& newest,
                         std::span<Feature> features) {
  for (Feature& feature : features) feature.returned_xy.reset();
  std::vector<cv::Mat> picture = LkPyramid(current, kWindowPx, kMaxLevel);
  std::vector<Feature*> tracked;
  std::vector<cv::Point2f> starts;
  for (std::size_t f = 0; f < features.size(); ++f) {
    if (!features[f].confirmed) continue;
    const Eigen::Vector2f xy = newest.col(static_cast<Eigen::Index>(f)).cast<float>();
    tracked.push_back(&features[f]);
    starts.emplace_back(xy.x(), xy.y());
  }
  const LkResult returned =
      TrackThereAndBack(previous_, picture, starts, kWindowPx, kMaxLevel, kReturnPx);
  for (std::size_t i = 0; i < tracked.size(); ++i) {
    if (returned.found[i] == 0) continue;
    tracked[i]->returned_xy = Eigen::Vector2d(returned.ends[i].x, returned.ends[i].y);
  }
  previous_ = std::move(picture);
}

Eigen::Matrix2Xd ThereAndBack::BetterStarts(const Pyramid& current,
                                            const Eigen::Matrix2Xd& guide,
                                            std::span<const Feature> features,
                                            int n) {
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
