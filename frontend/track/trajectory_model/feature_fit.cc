#include "frontend/track/trajectory_model/feature_fit.h"

#include <Eigen/Cholesky>

#include "frontend/track/trajectory_model/noise.h"

namespace cohort::trajectory_model {

FeatureEquations EquationsOfFeature(const State& state, std::size_t f, Noise noise) {
  // Half a pixel, until a measurement tells; chosen by eye on the tuning clips.
  const Eigen::Matrix2d kUnmeasuredAnchor = 4.0 * Eigen::Matrix2d::Identity();
  const Eigen::Index r = state.rank;
  const Feature& feature = state.features[f];
  FeatureEquations equations{Matrix::Zero(r + 2, r + 2), Vector::Zero(r + 2)};
  Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
  int count = 0;
  for (const Frame& frame : state.frames) {
    const Observation& o = frame.observations[f];
    if (!o.IsObserved()) continue;
    const Projection at = Project(frame.camera, feature.mean);
    const Eigen::Vector2d d = Residual(at, o, feature);
    const Eigen::Matrix2d W =
        noise == Noise::kStudent ? RobustInformation(o, d, frame.misfit) : o.information;
    const auto WJ = (W * at.of_z).eval();
    equations.information.topLeftCorner(r, r).noalias() += at.of_z.transpose() * WJ;
    equations.gradient.head(r).noalias() += WJ.transpose() * d;
    if (!o.anchor) {
      equations.information.bottomLeftCorner(2, r) += WJ;
      equations.information.bottomRightCorner<2, 2>() += W;
      equations.gradient.tail<2>() += W * d;
      sum += o.information;
      ++count;
    }
  }
  equations.anchor_information =
      count > 0 ? Eigen::Matrix2d(sum / count) : Eigen::Matrix2d(kUnmeasuredAnchor);
  equations.information.topRightCorner(r, 2) =
      equations.information.bottomLeftCorner(2, r).transpose();
  equations.information.diagonal().head(r).array() += 1.0;
  equations.information.bottomRightCorner<2, 2>() += equations.anchor_information;
  equations.gradient.head(r) -= feature.mean.head(r);
  equations.gradient.tail<2>() -= equations.anchor_information * feature.mean.tail<2>();
  return equations;
}

double CostOfFeature(const State& state,
                     std::size_t f,
                     const Eigen::Matrix2d& anchor_information,
                     Noise noise) {
  const Feature& feature = state.features[f];
  double cost = feature.mean.head(state.rank).squaredNorm() +
                feature.mean.tail<2>().dot(anchor_information * feature.mean.tail<2>());
  for (const Frame& frame : state.frames) {
    const Observation& o = frame.observations[f];
    if (!o.IsObserved()) continue;
    const Eigen::Vector2d d = Residual(Project(frame.camera, feature.mean), o, feature);
    const double square = d.dot(o.information * d);
    cost += noise == Noise::kStudent && !o.anchor
                ? frame.misfit * StudentCost(square / frame.misfit)
                : square;
  }
  return cost;
}

void FitFeature(State& state, std::size_t f) {
  constexpr int kStepsOfNew = 8;
  constexpr int kHalvings = 5;
  const Eigen::Index dimensions = state.rank + 2;
  Feature& feature = state.features[f];
  const bool is_new = feature.mean.size() != dimensions;
  if (is_new) feature.mean = Vector::Zero(dimensions);
  for (int i = 0; i < (is_new ? kStepsOfNew : 1); ++i) {
    // At zero the residuals of a new feature say nothing of its measurements.
    const Noise noise = is_new && i == 0 ? Noise::kGaussian : Noise::kStudent;
    const FeatureEquations equations = EquationsOfFeature(state, f, noise);
    feature.covariance =
        equations.information.llt().solve(Matrix::Identity(dimensions, dimensions));
    const Vector before = feature.mean;
    Vector step = feature.covariance * equations.gradient;
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
  for (std::size_t f = 0; f < state.features.size(); ++f) FitFeature(state, f);
}

}  // namespace cohort::trajectory_model
