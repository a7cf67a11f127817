#pragma once

#include <Eigen/Core>

namespace cohort {

// Trajectory matrix M, R x F with R = 2 (L + 1) (paper 3.2): column f is feature f's trajectory
// [px]. Rows 0, 1 are its current x, y (the unknowns T, 2 x F); rows 2l, 2l + 1 its x, y l frames
// ago (the history B, constant in a frame). The paper prints 2l + 1, 2l + 2, which would be one row
// too many. If centred, the mean column is subtracted from every column, which turns the affine
// constraint into a linear one. Only the Gram matrix G = M M' (R x R) is formed: its eigenvalues
// are the squared singular values of M.
class TrajectoryMatrix {
 public:
  // `history`: (R - 2) x F, newest frame first.
  TrajectoryMatrix(Eigen::MatrixXd history, bool centered);

  Eigen::Index rows() const { return history_.rows() + 2; }
  Eigen::Index features() const { return history_.cols(); }
  bool centered() const { return centered_; }
  const Eigen::MatrixXd& history() const { return history_; }  // centred if centered()

  // The rows T of M, centred if centered().
  Eigen::Matrix2Xd Current(const Eigen::Matrix2Xd& x) const;

  Eigen::MatrixXd Gram(const Eigen::Matrix2Xd& x) const;

  // G of x + d c is gram + d linear + d^2 quadratic: its cost along a line does not depend on F.
  struct Line {
    Eigen::MatrixXd gram;
    Eigen::MatrixXd linear;
    Eigen::MatrixXd quadratic;
    Eigen::MatrixXd At(double d) const { return gram + d * linear + (d * d) * quadratic; }
  };
  Line AlongLine(const Eigen::Matrix2Xd& x, const Eigen::Matrix2Xd& c) const;

  // Rows 0, 1 of H M for a symmetric H (R x R, of which rows 0, 1 are read): the gradient of a
  // spectral penalty with respect to x, 2 x F.
  Eigen::Matrix2Xd TopRowsOfProduct(const Eigen::MatrixXd& H, const Eigen::Matrix2Xd& x) const;

 private:
  Eigen::MatrixXd history_;
  Eigen::MatrixXd history_gram_;  // B B'
  bool centered_;
};

}  // namespace cohort
