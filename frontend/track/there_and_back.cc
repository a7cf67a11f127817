#include "frontend/track/there_and_back.h"

#include <cmath>
#include <utility>

#include "frontend/track/lucas_kanade.h"

namespace cohort {
namespace {

// As tracker klt is by default.
constexpr int kWindowPx = 21;
constexpr int kMaxLevel = 3;
constexpr double kReturnPx = 1.0;

}  // namespace

void ThereAndBack::Begin(const Pyramid& picture) {
  if (max_open_px_ > 0.0) previous_ = LkPyramid(picture, kWindowPx, kMaxLevel);
}

void ThereAndBack::Track(const Pyramid& current,
                         const Eigen::Matrix2Xd& newest,
                         std::span<Feature> features) {
  for (Feature& feature : features) feature.returned_xy.reset();
  if (!(max_open_px_ > 0.0)) return;
  std::vector<cv::Mat> picture = LkPyramid(current, kWindowPx, kMaxLevel);
  std::vector<Feature*> open;
  std::vector<cv::Point2f> starts;
  for (std::size_t f = 0; f < features.size(); ++f) {
    if (!features[f].open || !features[f].confirmed) continue;
    const Eigen::Vector2f xy = newest.col(static_cast<Eigen::Index>(f)).cast<float>();
    open.push_back(&features[f]);
    starts.emplace_back(xy.x(), xy.y());
  }
  const LkResult returned =
      TrackThereAndBack(previous_, picture, starts, kWindowPx, kMaxLevel, kReturnPx);
  for (std::size_t i = 0; i < open.size(); ++i) {
    if (returned.found[i] == 0) continue;
    open[i]->returned_xy = Eigen::Vector2d(returned.ends[i].x, returned.ends[i].y);
  }
  previous_ = std::move(picture);
}

bool ThereAndBack::IsOpen(const TrajectoryModel::Estimate& predicted) const {
  return max_open_px_ > 0.0 &&
         std::sqrt(0.5 * predicted.measured_covariance.trace()) > max_open_px_;
}

}  // namespace cohort
