#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <span>
#include <vector>

namespace cohort {

// The trajectories of all features as one probabilistic low-rank model (paper section 2: the
// trajectories of a rigid scene lie near a subspace of low dimension; here with perspective, noise,
// missing frames and uncertainty). In frame l feature f was measured at
//   y_lf = (m_l + B_l z_f) / (1 + c_l' z_f) + e_f + noise_lf,   z_f ~ N(0, I_r),
// with m_l, B_l, c_l (2 x 1, 2 x r, r x 1) the frame's, z_f the feature's coordinates, e_f the
// error of its anchor, which all its measurements share (none in the frame of the anchor itself,
// where the position is exact by definition), and noise_lf and e_f of the covariance that the
// measurement states. With r = 3, [m B; 1 c'] is a projective camera and z_f a point of a rigid
// scene in a projective frame; with c = 0 it is the paper's affine subspace. Fitted to a sliding
// window of frames with weights of Student's t: the newest cameras and all features by joint
// Levenberg-Marquardt steps, older cameras by expectation maximisation. The rank r grows while the
// residuals hold a direction that noise alone would not have, so that it fits few features, a
// plane, a scene and several bodies; beyond a rigid scene's 3 only for features seen often, as what
// has just come to cover the scene is none of its bodies.
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

  // Without perspective c = 0.
  TrajectoryModel(std::size_t max_frames, int max_rank, bool perspective)
      : max_frames_(max_frames), max_rank_(max_rank), perspective_(perspective) {}

  std::size_t frames() const { return frames_.size(); }
  int rank() const { return rank_; }

  // Where all features are in a new frame, from their own earlier measurements and what is measured
  // now of those that `now` sees. None (empty) where these are too few.
  std::vector<Estimate> Predict(std::span<const Observation> now) const;
  // Adds the frame; the estimates then count the features' own measurements in it.
  std::vector<Estimate> Update(std::span<const Observation> now);

  // By how much a feature's residuals exceed what their noise explains: chi-square over its degrees
  // of freedom, of all frames in the window; drawn to 1 where these are few.
  double Misfit(std::size_t feature) const;

  // The last measurement was wrong.
  void Forget(std::size_t feature);

  void Keep(std::span<const std::uint8_t> keep);
  // A feature's measurements in the newest frames, newest first; unseen in those before.
  void Add(std::span<const Observation> trajectory);

 private:
  static constexpr int kMaxDimensions = 12;
  static constexpr double kFirstDamping = 1e-3;
  using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, kMaxDimensions, 1>;
  using Matrix =
      Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, kMaxDimensions, kMaxDimensions>;
  using Camera = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, kMaxDimensions>;  // [m B; 1 c']
  struct Frame {
    std::vector<Observation> observations;
    Camera camera;
    double misfit = 1.0;  // median square of the residuals over what their noise explains
  };
  struct Feature {
    Vector mean;  // of (z, e)
    Matrix covariance;
  };
  struct Fit {
    Camera camera;
    Eigen::MatrixXd covariance;  // of vec(camera)
  };
  struct Projection {
    Eigen::Vector2d xy;
    Eigen::Matrix<double, 2, 3> of_homogeneous;                           // d xy / d (camera [1 z])
    Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, kMaxDimensions> of_z;  // d xy / d z
  };

  Projection Project(const Camera& camera, const Vector& z) const;
  Eigen::Vector2d Residual(const Projection& projection,
                           const Observation& o,
                           const Feature& feature) const;
  bool CanFit(std::span<const Observation> now) const;
  void Fix(Eigen::Ref<Eigen::MatrixXd> normal) const;
  Fit FitCamera(std::span<const Observation> now) const;
  Estimate Of(const Fit& fit, const Feature& feature) const;
  std::vector<Estimate> All(const Fit& fit) const;
  struct Normal {
    Matrix information;
    Vector gradient;
    Eigen::Matrix2d of_anchor = Eigen::Matrix2d::Zero();  // information of its prior
  };
  Normal NormalOf(std::size_t f, bool robust) const;
  double Cost(std::size_t f, const Eigen::Matrix2d& of_anchor, bool robust) const;
  void InferFeature(std::size_t f);
  void UpdateMisfit(Frame& frame) const;
  void RefitCamera(Frame& frame) const;
  struct Eliminated;
  Eliminated Eliminate(std::size_t f, Eigen::MatrixXd& normal, Eigen::VectorXd& rhs) const;
  void StepJointly();
  void CenterDepths();
  void Normalize();
  struct Cell;
  struct Direction;
  Direction Explain(std::span<const Cell> cells, Eigen::VectorXd v) const;
  std::size_t TimesSeen(std::size_t f) const;
  void AdaptRank();

  std::size_t max_frames_;
  int max_rank_;
  bool perspective_;
  int rank_ = 0;
  double damping_ = 1e-3;     // of the joint steps
  std::deque<Frame> frames_;  // newest first
  std::vector<Feature> features_;
};

}  // namespace cohort
