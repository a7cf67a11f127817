#include "frontend/track/prediction.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

namespace cohort {
namespace {

constexpr Eigen::Index kLeastTrusted = 8;

// The value at which half of the weight lies below.
double WeightedMedian(std::vector<std::pair<double, double>> value_and_weight) {
  std::sort(value_and_weight.begin(), value_and_weight.end());
  double total = 0.0;
  for (const auto& [value, weight] : value_and_weight) total += weight;
  double below = 0.0;
  for (const auto& [value, weight] : value_and_weight) {
    below += weight;
    if (below >= 0.5 * total) return value;
  }
  return 0.0;
}

// x = A (h - mean_h) + mean_x, fitted to the columns of H and X.
struct AffineFit {
  Eigen::MatrixXd A;
  Eigen::VectorXd mean_h;
  Eigen::Vector2d mean_x = Eigen::Vector2d::Zero();
  Eigen::MatrixXd whitening;  // leverage of h is |whitening (h - mean_h)|^2
  double spread_px = 0.0;

  Eigen::Vector2d At(const Eigen::VectorXd& h) const { return A * (h - mean_h) + mean_x; }
};

AffineFit FitAffine(const Eigen::MatrixXd& H,
                    const Eigen::Matrix2Xd& X,
                    const Eigen::VectorXd& prior_weights) {
  constexpr Eigen::Index kSignalDimensions = 4;
  constexpr double kLeastNoisePx = 0.02;  // where the history is too short to tell
  AffineFit fit;
  Eigen::VectorXd weights = prior_weights;
  for (int pass = 0; pass < 4; ++pass) {
    const double total = weights.sum();
    fit.mean_h = H * weights / total;
    fit.mean_x = X * weights / total;
    const Eigen::MatrixXd H0 = H.colwise() - fit.mean_h;
    const Eigen::MatrixXd HW = H0 * weights.asDiagonal();
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(HW * H0.transpose());
    const Eigen::VectorXd& lambda = eigen.eigenvalues();
    double ridge = total * kLeastNoisePx * kLeastNoisePx;
    const Eigen::Index noise_dimensions = lambda.size() - kSignalDimensions;
    if (noise_dimensions > 0) ridge = std::max(ridge, lambda[(noise_dimensions - 1) / 2]);
    const Eigen::VectorXd inverse = (lambda.array() + ridge).inverse();
    const Eigen::MatrixXd& U = eigen.eigenvectors();
    const Eigen::MatrixXd XH = (X.colwise() - fit.mean_x) * HW.transpose();
    fit.A = XH * U * inverse.asDiagonal() * U.transpose();
    fit.whitening = inverse.cwiseSqrt().asDiagonal() * U.transpose();

    const Eigen::Matrix2Xd misses = (fit.A * H0).colwise() + fit.mean_x - X;
    std::vector<std::pair<double, double>> errors;
    for (Eigen::Index i = 0; i < misses.cols(); ++i) {
      errors.emplace_back(misses.col(i).norm(), prior_weights[i]);
    }
    // 0.85: from the median distance in the plane to one coordinate's deviation, if Gaussian.
    fit.spread_px = std::max(0.85 * WeightedMedian(errors), kLeastNoisePx);
    for (Eigen::Index i = 0; i < misses.cols(); ++i) {
      const double u = errors[static_cast<std::size_t>(i)].first / (6.0 * fit.spread_px);
      weights[i] = u < 1.0 ? prior_weights[i] * (1.0 - u * u) * (1.0 - u * u) : 0.0;
    }
    if (weights.sum() < 0.25 * prior_weights.sum()) break;
  }
  return fit;
}

// The coordinates of `features` in `frames`, one column a feature.
Eigen::MatrixXd Rows(const CohortHistory& history,
                     const std::vector<std::size_t>& frames,
                     const std::vector<Eigen::Index>& features) {
  Eigen::MatrixXd rows(2 * static_cast<Eigen::Index>(frames.size()),
                       static_cast<Eigen::Index>(features.size()));
  for (std::size_t n = 0; n < frames.size(); ++n) {
    rows.middleRows<2>(2 * static_cast<Eigen::Index>(n)) =
        history.positions[frames[n]](Eigen::all, features);
  }
  return rows;
}

}  // namespace

std::optional<CohortPrediction> PredictCohort(const CohortHistory& history,
                                              std::size_t num_frames,
                                              const Eigen::Matrix2Xd& x,
                                              const std::vector<std::uint8_t>& trusted) {
  std::vector<std::size_t> frames;
  for (std::size_t l = 0; l < std::min(num_frames, history.frames()); ++l) frames.push_back(l);
  std::vector<Eigen::Index> chosen;
  std::vector<Eigen::Index> all;
  for (Eigen::Index f = 0; f < x.cols(); ++f) {
    all.push_back(f);
    if (trusted[static_cast<std::size_t>(f)]) chosen.push_back(f);
  }
  const auto C = static_cast<Eigen::Index>(chosen.size());
  if (C < kLeastTrusted || frames.empty()) return std::nullopt;
  const Eigen::MatrixXd h = Rows(history, frames, all);
  const AffineFit fit =
      FitAffine(h(Eigen::all, chosen), x(Eigen::all, chosen), Eigen::VectorXd::Ones(C));
  CohortPrediction prediction;
  prediction.x = (fit.A * (h.colwise() - fit.mean_h)).colwise() + fit.mean_x;
  prediction.spread_px = fit.spread_px;
  prediction.noise_gain = 0.5 * fit.A.squaredNorm();
  prediction.leverage = (fit.whitening * (h.colwise() - fit.mean_h)).colwise().squaredNorm();
  return prediction;
}

std::optional<FeaturePrediction> PredictFeature(const CohortHistory& history,
                                                std::size_t max_frames,
                                                const Eigen::Matrix2Xd& x,
                                                const std::vector<std::uint8_t>& trusted,
                                                Eigen::Index feature) {
  constexpr double kNearPx = 120.0;
  constexpr double kFarWeight = 0.05;
  std::vector<std::size_t> frames;
  for (std::size_t l = 0; l < history.frames() && frames.size() < max_frames; ++l) {
    if (history.seen[l][static_cast<std::size_t>(feature)]) frames.push_back(l);
  }
  // Those that were seen in the same frames teach; the older the frames, the fewer they are.
  std::vector<Eigen::Index> teachers;
  for (; !frames.empty(); frames.resize(frames.size() * 3 / 4)) {
    teachers.clear();
    for (Eigen::Index g = 0; g < x.cols(); ++g) {
      const auto i = static_cast<std::size_t>(g);
      if (g == feature || !trusted[i]) continue;
      const bool complete = std::all_of(
          frames.begin(), frames.end(), [&](std::size_t l) { return history.seen[l][i] != 0; });
      if (complete) teachers.push_back(g);
    }
    if (teachers.size() >= std::max<std::size_t>(kLeastTrusted, 2 * frames.size())) break;
  }
  if (frames.empty()) return std::nullopt;

  const Eigen::Vector2d at = history.positions[frames.front()].col(feature);
  Eigen::VectorXd weights(static_cast<Eigen::Index>(teachers.size()));
  for (std::size_t i = 0; i < teachers.size(); ++i) {
    const double square = (history.positions[frames.front()].col(teachers[i]) - at).squaredNorm();
    weights[static_cast<Eigen::Index>(i)] =
        kFarWeight + std::exp(-0.5 * square / (kNearPx * kNearPx));
  }
  const AffineFit fit =
      FitAffine(Rows(history, frames, teachers), x(Eigen::all, teachers), weights);
  const Eigen::VectorXd h = Rows(history, frames, {feature});
  const double leverage = (fit.whitening * (h - fit.mean_h)).squaredNorm();
  return FeaturePrediction{fit.At(h), fit.spread_px * std::sqrt(1.0 + leverage)};
}

}  // namespace cohort
