#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

namespace cohort {

// The courses of all features as one probabilistic low-rank model (paper section 2: the
// trajectories of a rigid scene lie near a subspace of low dimension; here with noise, missing
// frames and uncertainty). In frame l feature f was measured at
//   y_lf = m_l + B_l z_f + e_f + noise_lf,   z_f ~ N(0, I_r),
// with m_l, B_l (2 x 1, 2 x r) the frame's, z_f the feature's coordinates in the subspace, e_f the
// error of its anchor, which all its measurements share (none in the frame of the anchor itself,
// where the position is exact by definition), and noise_lf and e_f of the covariance that the
// measurement states. Fitted by expectation maximisation with weights of Student's t, over a
// sliding window of frames. The rank r grows while the residuals hold a direction that noise alone
// would not have, so that it fits few features, strong perspective and several bodies.
class TrajectoryModel {
 public:
  struct Observation {
    Eigen::Vector2d xy = Eigen::Vector2d::Zero();
    Eigen::Matrix2d information = Eigen::Matrix2d::Zero();  // [1/px^2]; zero: not seen
    bool anchor = false;                                    // its anchor was taken here
  };
  struct Estimate {
    Eigen::Vector2d xy = Eigen::Vector2d::Zero();           // of the point of the scene
    Eigen::Matrix2d covariance = Eigen::Matrix2d::Zero();   // of xy
    Eigen::Vector2d measured_xy = Eigen::Vector2d::Zero();  // where it will be measured: with e_f
    Eigen::Matrix2d measured_covariance = Eigen::Matrix2d::Zero();  // without the noise of that
  };

  TrajectoryModel(std::size_t max_frames, int max_rank)
      : max_frames_(max_frames), max_rank_(max_rank) {}

  std::size_t frames() const { return frames_.size(); }
  int rank() const { return rank_; }

  // Where all features are in a new frame, from their own earlier measurements and what is measured
  // now of those that `now` sees. None (empty) where these are too few.
  std::vector<Estimate> Predict(std::span<const Observation> now) const;
  // Adds the frame; the estimates then count the features' own measurements in it.
  std::vector<Estimate> Update(std::span<const Observation> now);

  // The last measurement was wrong.
  void Forget(std::size_t feature);

  void Keep(std::span<const std::uint8_t> keep);
  // A feature's measurements in the newest frames, newest first; unseen in those before.
  void Add(std::span<const Observation> course);

 private:
  static constexpr int kMaxDimensions = 12;
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxDimensions, 1>;
  using Matrix =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxDimensions, kMaxDimensions>;
  using Loadings = Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kMaxDimensions>;  // [m B]
  struct Frame {
    std::vector<Observation> observations;
    Loadings loadings;
  };
  struct Feature {
    Vector mean;  // of (z, e)
    Matrix covariance;
  };
  struct Fit {
    Loadings loadings;
    Eigen::MatrixXd covariance;  // of vec(loadings)
  };

  Eigen::Vector2d Residual(const Loadings& loadings,
                           const Observation& o,
                           const Feature& feature) const;
  bool CanFit(std::span<const Observation> now) const;
  Fit FitLoadings(std::span<const Observation> now) const;
  Estimate Of(const Fit& fit, const Feature& feature) const;
  std::vector<Estimate> All(const Fit& fit) const;
  void InferFeature(std::size_t f);
  void RefitLoadings(Frame& frame) const;
  void Normalize();
  void AdaptRank();

  std::size_t max_frames_;
  int max_rank_;
  int rank_ = 0;
  std::deque<Frame> frames_;  // newest first
  std::vector<Feature> features_;
};

}  // namespace cohort
