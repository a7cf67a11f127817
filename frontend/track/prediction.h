#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

namespace cohort {

// Where all features were in the last frames, newest first, and in which of these positions the
// image was seen to confirm them.
struct CohortHistory {
  std::deque<Eigen::Matrix2Xd> positions;      // each 2 x F [px]
  std::deque<std::vector<std::uint8_t>> seen;  // each F, 0 or 1

  std::size_t frames() const { return positions.size(); }
};

// The affine model of the cohort (paper section 2: the trajectories of a rigid scene under an
// affine camera lie in a 3-dimensional affine space): a feature's position now is an affine
// function of its own positions in earlier frames,
//   x_f = A h_f + c,   h_f the 2 n coordinates of n frames,
// the same A and c for all features. Fitted to the trusted features by ridge regression with
// Tukey's weights. The ridge is the history's noise (the eigenvalues beyond the fourth), so that
// directions that noise alone spans do not count.

// For all features from the L newest frames.
struct CohortPrediction {
  Eigen::Matrix2Xd x;        // 2 x F
  double spread_px = 0.0;    // typical distance of the trusted features from it, a coordinate
  double noise_gain = 0.0;   // variance that it takes over from the history, a coordinate
  Eigen::VectorXd leverage;  // F: about 3 / C among C trusted ones, large for an extrapolation
};
// `x`: positions now, of which those of `trusted` features count. None where too few are trusted.
std::optional<CohortPrediction> PredictCohort(const CohortHistory& history,
                                              std::size_t num_frames,
                                              const Eigen::Matrix2Xd& x,
                                              const std::vector<std::uint8_t>& trusted);

// For one feature from the newest frames in which it was seen itself, however long ago that is, so
// that errors of prediction do not feed on themselves; features near it count more (cameras are
// affine only locally).
struct FeaturePrediction {
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();
  double sigma_px = 0.0;  // expected distance of a measured position from it, a coordinate
};
std::optional<FeaturePrediction> PredictFeature(const CohortHistory& history,
                                                std::size_t max_frames,
                                                const Eigen::Matrix2Xd& x,
                                                const std::vector<std::uint8_t>& trusted,
                                                Eigen::Index feature);

}  // namespace cohort
