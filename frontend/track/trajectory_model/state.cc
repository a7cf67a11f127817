#include "frontend/track/trajectory_model/state.h"

#include <algorithm>
#include <utility>

#include "frontend/core/statistics.h"
#include "frontend/track/trajectory_model/noise.h"

namespace cohort::trajectory_model {

double MisfitOfFrame(const Frame& frame, std::span<const Feature> features) {
  std::vector<double> squares;
  for (std::size_t f = 0; f < features.size(); ++f) {
    const Observation& o = frame.observations[f];
    if (!o.IsObserved() || o.anchor) continue;
    const Eigen::Vector2d d = Residual(Project(frame.camera, features[f].mean), o, features[f]);
    squares.push_back(d.dot(o.information * d));
  }
  return std::max(1.0, Median(std::move(squares)) / kMedianChiSquare);
}

double MisfitOfFeature(const State& state, std::size_t f) {
  // Degrees of freedom that count as if they fitted; chosen by eye on the tuning clips.
  constexpr double kPrior = 6.0;
  if (state.rank == 0) return 1.0;
  const Feature& feature = state.features[f];
  double chi_square = kPrior;
  double freedom = -static_cast<double>(state.rank);
  for (const Frame& frame : state.frames) {
    const Observation& o = frame.observations[f];
    if (!o.IsObserved() || o.anchor) continue;
    const Eigen::Vector2d d = Residual(Project(frame.camera, feature.mean), o, feature);
    chi_square += d.dot(o.information * d);
    freedom += 2.0;
  }
  return chi_square / (std::max(freedom, 0.0) + kPrior);
}

std::size_t CountObserved(const State& state, std::size_t f) {
  return static_cast<std::size_t>(
      std::count_if(state.frames.begin(), state.frames.end(), [f](const Frame& frame) {
        const Observation& o = frame.observations[f];
        return o.IsObserved() && !o.anchor;
      }));
}

}  // namespace cohort::trajectory_model
