#include "frontend/track/trajectory_model/state.h"

#include <algorithm>
#include <utility>

#include "frontend/core/statistics.h"
#include "frontend/track/trajectory_model/noise.h"
#include "frontend/track/trajectory_model/sized.h"

namespace cohort::trajectory_model {

namespace {

template <int R>
double SquareOf(const Frame& frame, const Observation& o, const FeaturePosterior& feature) {
  const auto mean = Sized<R>::MeanOf(feature);
  const auto at = ProjectSized<R>(Sized<R>::Of(frame.camera), mean);
  const Eigen::Vector2d d = SizedResidual<R>(at, o, mean);
  return d.dot(o.information * d);
}

}  // namespace

double MisfitOfFrame(const Frame& frame, std::span<const FeaturePosterior> features) {
  std::vector<double> squares;
  squares.reserve(features.size());
  WithRank(static_cast<int>(frame.camera.cols()) - 1, [&](auto rank) {
    for (std::size_t f = 0; f < features.size(); ++f) {
      const Observation& o = frame.observations[f];
      if (!o.IsObserved() || o.anchor) continue;
      squares.push_back(SquareOf<rank.value>(frame, o, features[f]));
    }
  });
  return std::max(1.0, Median(std::move(squares)) / kMedianChiSquare2);
}

double MisfitOfFeature(const State& state, std::size_t f) {
  // Additional degrees of freedom that count as fitting. Tuned on the tuning clips.
  constexpr double kPrior = 6.0;
  if (state.rank == 0) return 1.0;
  double chi_square = kPrior;
  double freedom = -static_cast<double>(state.rank);
  WithRank(state.rank, [&](auto rank) {
    for (const Frame& frame : state.frames) {
      const Observation& o = frame.observations[f];
      if (!o.IsObserved() || o.anchor) continue;
      chi_square += SquareOf<rank.value>(frame, o, state.features[f]);
      freedom += 2.0;
    }
  });
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
