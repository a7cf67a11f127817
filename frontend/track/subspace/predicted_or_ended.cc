#include "frontend/track/subspace/predicted_or_ended.h"

#include <cmath>

namespace cohort {
namespace {

// An occluded feature changes at once. A feature that has changed slowly, by this factor over what
// noise explains, is a corner where two surfaces overlap and a point of neither, so it does not
// come back. Tuned on the tuning clips.
constexpr double kSlowChange = 1.25;

}  // namespace

Move HoldOrEnd(const Eigen::Vector2d& guide,
               const TrajectoryModel::Estimate* predicted,
               const Confirmation& confirmation,
               int max_unexplained_frames,
               double max_sigma_px,
               MeasuredFeature& feature) {
  Move move;
  move.state = ObservationState::kPredicted;
  move.xy = guide;
  ++feature.unexplained_frames;
  bool unknown = false;
  if (predicted != nullptr) {
    move.xy = predicted->xy;
    if (confirmation.IsHidden(feature, *predicted)) feature.unexplained_frames = 0;
    unknown = std::sqrt(0.5 * predicted->measured_covariance.trace()) > max_sigma_px;
  }
  const bool is_another =
      feature.unexplained_frames > max_unexplained_frames || feature.change > kSlowChange;
  if (max_unexplained_frames > 0 && (unknown || is_another)) {
    move.loss = LossReason::kContradicted;
  }
  return move;
}

}  // namespace cohort
