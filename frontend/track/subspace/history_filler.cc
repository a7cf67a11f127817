#include "frontend/track/subspace/history_filler.h"

#include <algorithm>
#include <numeric>
#include <utility>

#include "frontend/core/part_times.h"

namespace cohort {
namespace {

// An anchor is where its corner was found, up to this [px]; it defines the point.
constexpr double kAnchorSigmaPx = 0.05;
constexpr std::size_t kNeighbours = 8;
// Neighbours whose motions differ by more do not tell that of a new feature [px]. By eye on the
// tuning clips.
constexpr double kCommonMotionPx = 2.0;

// Old features around a position, the nearest first; of equal ones the older first.
struct Neighbours {
  std::vector<Eigen::Index> features;
  std::vector<double> weights;  // [1/px^2]
};

Neighbours Nearest(const Eigen::Matrix2Xd& others, const Eigen::Vector2d& xy) {
  constexpr double kReachPx = 10.0;  // within it all weigh about the same
  Neighbours near;
  near.features.resize(static_cast<std::size_t>(others.cols()));
  std::iota(near.features.begin(), near.features.end(), Eigen::Index{0});
  const auto distance = [&](Eigen::Index g) { return (others.col(g) - xy).squaredNorm(); };
  const auto count = std::min(kNeighbours, near.features.size());
  std::partial_sort(near.features.begin(),
                    near.features.begin() + static_cast<std::ptrdiff_t>(count),
                    near.features.end(),
                    [&](Eigen::Index a, Eigen::Index b) {
                      return std::pair(distance(a), a) < std::pair(distance(b), b);
                    });
  near.features.resize(count);
  for (const Eigen::Index g : near.features) {
    near.weights.push_back(1.0 / (kReachPx * kReachPx + distance(g)));
  }
  return near;
}

struct Motion {
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();  // [px]
  double variance = 0.0;                           // [px^2], of both coordinates together
};

// How the neighbours moved between two frames; nothing moves where there are none.
Motion MotionOf(const Neighbours& near, const Eigen::Matrix2Xd& from, const Eigen::Matrix2Xd& to) {
  Eigen::Vector2d motion = Eigen::Vector2d::Zero();
  double square = 0.0;
  double total = 0.0;
  for (std::size_t k = 0; k < near.features.size(); ++k) {
    const Eigen::Index g = near.features[k];
    const double weight = near.weights[k];
    const Eigen::Vector2d of_neighbour = to.col(g) - from.col(g);
    motion += weight * of_neighbour;
    square += weight * of_neighbour.squaredNorm();
    total += weight;
  }
  if (total > 0.0) {
    motion /= total;
    square /= total;
  }
  return {motion, square - motion.squaredNorm()};
}

}  // namespace

void HistoryFiller::Begin(Pyramid picture) {
  pictures_.clear();
  pictures_.push_front(std::move(picture));
}

void HistoryFiller::Remember(Pyramid picture, std::size_t history_length) {
  pictures_.push_front(std::move(picture));
  if (pictures_.size() > history_length) pictures_.pop_back();
}

FilledHistory HistoryFiller::Fill(const Eigen::Vector2d& xy,
                                  const AnchorPatch& anchor,
                                  const History& others,
                                  const CovarianceCalibration& calibration) const {
  const TimedPart part("births");
  const Neighbours near = Nearest(others.front(), xy);
  FilledHistory past;
  past.xy.push_back(xy);
  past.measured.push_back(
      {xy, Eigen::Matrix2d::Identity() / (kAnchorSigmaPx * kAnchorSigmaPx), true});
  bool move_alike = true;
  for (std::size_t l = 1; l < others.size(); ++l) {
    const Motion motion = MotionOf(near, others[l - 1], others[l]);
    move_alike = move_alike && motion.variance <= 2.0 * kCommonMotionPx * kCommonMotionPx;
    const Eigen::Vector2d guessed = past.xy.back() + motion.mean;
    past.xy.push_back(guessed);
    past.measured.emplace_back();
    if (!move_alike) continue;
    const Measurement m =
        MeasurePatch(pictures_[l], anchor, guessed, patch_.window_px, calibration.scale());
    if (m.converged && m.correlation >= patch_.min_correlation &&
        (m.xy - guessed).norm() <= patch_.max_distance_px) {
      past.xy.back() = m.xy;
      past.measured.back() = calibration.ForModel(m);
    }
  }
  return past;
}

}  // namespace cohort
