#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <span>

#include "frontend/energy/penalty.h"
#include "frontend/energy/trajectory_matrix.h"

namespace cohort {

// Total energy on one pyramid level, paper equation (3) and, with P = 0, (2):
//   C(x) = sum_f a_f c_f(x_f) + P(M(x)),   x: 2 x F [px of the level]
// c_f is the mean absolute difference of patch_energy.h. The weights a_f include equation (7), n^2
// alpha = 1 / m (weak) or 1 / (m F) (strong), divided by the picture's contrast. a_f is 0 for a
// feature whose patch is not trusted at the moment.
class TotalEnergy {
 public:
  // `patches`: F pointers to n x n templates. `trajectories` and `penalty` null: no penalty. All
  // pointers and references must outlive this.
  TotalEnergy(const cv::Mat& picture,
              std::span<const float* const> patches,
              int n,
              Eigen::VectorXd data_weights,
              const TrajectoryMatrix* trajectories,
              const Penalty* penalty);

  double Value(const Eigen::Matrix2Xd& x) const;
  double DataValue(const Eigen::Matrix2Xd& x) const;
  Eigen::Matrix2Xd Gradient(const Eigen::Matrix2Xd& x) const;  // dC/dx, 2 x F

  // C(x + d c) as a function of d; the cost of the penalty does not grow with F.
  class Line {
   public:
    double operator()(double d) const;

   private:
    friend class TotalEnergy;
    const TotalEnergy* energy_ = nullptr;
    Eigen::Matrix2Xd x_;
    Eigen::Matrix2Xd c_;
    TrajectoryMatrix::Line gram_;
  };
  Line Along(const Eigen::Matrix2Xd& x, const Eigen::Matrix2Xd& c) const;

  Eigen::Index features() const { return static_cast<Eigen::Index>(patches_.size()); }
  const cv::Mat& picture() const { return *picture_; }
  std::span<const float> patch(Eigen::Index f) const;
  int patch_side() const { return n_; }
  const Eigen::VectorXd& data_weights() const { return data_weights_; }
  const TrajectoryMatrix* trajectories() const { return trajectories_; }
  const Penalty* penalty() const { return penalty_; }

 private:
  double PenaltyOf(const Eigen::MatrixXd& gram) const;

  const cv::Mat* picture_;
  std::span<const float* const> patches_;
  int n_;
  Eigen::VectorXd data_weights_;
  const TrajectoryMatrix* trajectories_;
  const Penalty* penalty_;
};

}  // namespace cohort
