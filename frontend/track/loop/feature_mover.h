#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "frontend/image/pyramid.h"
#include "frontend/tracks/observation.h"
#include "frontend/tracks/track_set.h"

namespace cohort {

// The position to which a mover moves a feature.
struct Move {
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();
  ObservationState state = ObservationState::kObserved;
  double residual = 0.0;  // mean absolute difference to the template, intensities 0..1
  std::optional<PixelCovariance> covariance;
  std::optional<LossReason> loss;  // set: the feature ends, xy is not used
};

// What differs between trackers: how the live features move from one frame to the next. The
// features are numbered 0 .. F - 1 in the order of their birth; a mover keeps its own data
// (templates, history) in the same order.
class FeatureMover {
 public:
  virtual ~FeatureMover() = default;
  // Called once a frame, with the current picture. Returns one Move for every feature.
  virtual std::vector<Move> MoveFeatures(const Pyramid& current) = 0;
  // Called after the loop has decided which features survive: keep[f] == 0 ends feature f.
  virtual void Keep(std::span<const std::uint8_t> keep) = 0;
  // Appends new features at these positions of the current picture.
  virtual void Add(std::span<const Eigen::Vector2d> born, const Pyramid& current) = 0;
};

}  // namespace cohort
