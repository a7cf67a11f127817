#include "frontend/track/trajectory_model/feature_fit.h"

#include <Eigen/Cholesky>

#include "frontend/core/in_parallel.h"
#include "frontend/track/trajectory_model/noise.h"
#include "frontend/track/trajectory_model/sized.h"

namespace cohort::trajectory_model {
namespace {

// Half a pixel, until there is a measurement. Tuned on the tuning clips.
constexpr double kUnmeasuredAnchorInformation = 4.0;

// Twice the negative logarithm of the prior.
template <typename Unknowns>
double CostOfPrior(const Unknowns& mean, const Eigen::Matrix2d& anchor_information) {
  const Eigen::Vector2d e = mean.template tail<2>();
  return mean.head(mean.size() - 2).squaredNorm() + e.dot(anchor_information * e);
}

// The same of a measurement with the square d' information d.
double CostOfSquare(const Frame& frame, const Observation& o, double square, Noise noise) {
  if (noise == Noise::kGaussian || o.anchor) return square;
  return frame.misfit * StudentCost(square / frame.misfit);
}

template <int R, bool kWithCost>
FeatureEquationsAndCost SizedEquations(const State& state, std::size_t f, Noise noise) {
  const Eigen::Index r = state.rank;
  const auto mean = Sized<R>::MeanOf(state.features[f]);
  typename Sized<R>::Information information = Sized<R>::Information::Zero(r + 2, r + 2);
  typename Sized<R>::Unknowns gradient = Sized<R>::Unknowns::Zero(r + 2);
  Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
  int count = 0;
  double cost = 0.0;
  for (const Frame& frame : state.frames) {
    const Observation& o = frame.observations[f];
    if (!o.IsObserved()) continue;
    const auto at = ProjectSized<R>(Sized<R>::Of(frame.camera), mean);
    const Eigen::Vector2d d = SizedResidual<R>(at, o, mean);
    const Eigen::Matrix2d W =
        noise == Noise::kStudent ? RobustInformation(o, d, frame.misfit) : o.information;
    if constexpr (kWithCost) cost += CostOfSquare(frame, o, d.dot(o.information * d), noise);
    const typename Sized<R>::OfZ WJ = W.lazyProduct(at.of_z);
    information.topLeftCorner(r, r) += at.of_z.transpose().lazyProduct(WJ);
    gradient.head(r) += WJ.transpose().lazyProduct(d);
    if (!o.anchor) {
      information.bottomLeftCorner(2, r) += WJ;
      information.template bottomRightCorner<2, 2>() += W;
      gradient.template tail<2>() += W * d;
      sum += o.information;
      ++count;
    }
  }
  const Eigen::Matrix2d anchor_information =
      count > 0 ? Eigen::Matrix2d(sum / count)
                : Eigen::Matrix2d(kUnmeasuredAnchorInformation * Eigen::Matrix2d::Identity());
  information.topRightCorner(r, 2) = information.bottomLeftCorner(2, r).transpose();
  information.diagonal().head(r).array() += 1.0;
  information.template bottomRightCorner<2, 2>() += anchor_information;
  gradient.head(r) -= mean.head(r);
  gradient.template tail<2>() -= anchor_information * mean.template tail<2>();
  return {{information, gradient, anchor_information},
          cost + CostOfPrior(mean, anchor_information)};
}

template <int R>
double SizedCost(const State& state,
                 std::size_t f,
                 const Eigen::Matrix2d& anchor_information,
                 Noise noise) {
  const auto mean = Sized<R>::MeanOf(state.features[f]);
  double cost = CostOfPrior(mean, anchor_information);
  for (const Frame& frame : state.frames) {
    const Observation& o = frame.observations[f];
    if (!o.IsObserved()) continue;
    const auto at = ProjectSized<R>(Sized<R>::Of(frame.camera), mean);
    const Eigen::Vector2d d = SizedResidual<R>(at, o, mean);
    cost += CostOfSquare(frame, o, d.dot(o.information * d), noise);
  }
  return cost;
}

}  // namespace

FeatureEquations EquationsOfFeature(const State& state, std::size_t f, Noise noise) {
  return WithRank(state.rank, [&](auto rank) {
    return SizedEquations<rank.value, false>(state, f, noise).equations;
  });
}

FeatureEquationsAndCost EquationsAndCostOfFeature(const State& state, std::size_t f, Noise noise) {
  return WithRank(state.rank,
                  [&](auto rank) { return SizedEquations<rank.value, true>(state, f, noise); });
}

double CostOfFeature(const State& state,
                     std::size_t f,
                     const Eigen::Matrix2d& anchor_information,
                     Noise noise) {
  return WithRank(state.rank, [&](auto rank) {
    return SizedCost<rank.value>(state, f, anchor_information, noise);
  });
}

void FitFeature(State& state, std::size_t f) {
  constexpr int kStepsOfNew = 8;
  constexpr int kHalvings = 5;
  // Half the square of a step in its standard deviations, below which the posterior is practically
  // quadratic. Such a step needs no comparison of costs, which takes twice the time of the step.
  constexpr double kSmallStep = 0.1;
  const Eigen::Index dimensions = state.rank + 2;
  FeaturePosterior& feature = state.features[f];
  const bool is_new = feature.mean.size() != dimensions;
  if (is_new) feature.mean = Vector::Zero(dimensions);
  for (int i = 0; i < (is_new ? kStepsOfNew : 1); ++i) {
    // At zero the residuals of a new feature do not show which of its measurements are outliers.
    const Noise noise = is_new && i == 0 ? Noise::kGaussian : Noise::kStudent;
    const FeatureEquations equations = EquationsOfFeature(state, f, noise);
    feature.covariance = InverseOf(equations.information);
    const Vector before = feature.mean;
    Vector step = feature.covariance * equations.gradient;
    if (!is_new && step.dot(equations.gradient) <= kSmallStep) {
      feature.mean = before + step;
      return;
    }
    const double cost = CostOfFeature(state, f, equations.anchor_information, noise);
    for (int halving = 0;; ++halving, step *= 0.5) {
      feature.mean = before + step;
      if (CostOfFeature(state, f, equations.anchor_information, noise) <= cost) break;
      if (halving == kHalvings) {
        feature.mean = before;
        return;
      }
    }
  }
}

void FitAllFeatures(State& state) {
  ForEachInParallel(state.features.size(), [&](std::size_t f) { FitFeature(state, f); });
}

Matrix InverseOf(const Matrix& information) {
  return WithRank(static_cast<int>(information.rows()) - 2, [&](auto rank) -> Matrix {
    using Information = typename Sized<rank.value>::Information;
    const Eigen::Index n = information.rows();
    const Eigen::Map<const Information> sized(information.data(), n, n);
    return Eigen::LLT<Information>(sized).solve(Information::Identity(n, n));
  });
}

}  // namespace cohort::trajectory_model
