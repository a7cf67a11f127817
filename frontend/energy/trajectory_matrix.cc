#include "frontend/energy/trajectory_matrix.h"

#include <utility>

namespace cohort {

TrajectoryMatrix::TrajectoryMatrix(Eigen::MatrixXd history, bool centered)
    : history_(std::move(history)), centered_(centered) {
  if (centered_ && history_.cols() > 0) history_.colwise() -= history_.rowwise().mean().eval();
  history_gram_ = history_ * history_.transpose();
}

Eigen::Matrix2Xd TrajectoryMatrix::Current(const Eigen::Matrix2Xd& x) const {
  if (!centered_) return x;
  return x.colwise() - x.rowwise().mean().eval();
}

Eigen::MatrixXd TrajectoryMatrix::Gram(const Eigen::Matrix2Xd& x) const {
  const Eigen::Matrix2Xd T = Current(x);
  const Eigen::Index L2 = history_.rows();
  Eigen::MatrixXd G(rows(), rows());
  G.topLeftCorner(2, 2) = T * T.transpose();
  G.topRightCorner(2, L2).noalias() = T * history_.transpose();
  G.bottomLeftCorner(L2, 2) = G.topRightCorner(2, L2).transpose();
  G.bottomRightCorner(L2, L2) = history_gram_;
  return G;
}

TrajectoryMatrix::Line TrajectoryMatrix::AlongLine(const Eigen::Matrix2Xd& x,
                                                   const Eigen::Matrix2Xd& c) const {
  const Eigen::Matrix2Xd T = Current(x);
  const Eigen::Matrix2Xd C = Current(c);
  const Eigen::Index L2 = history_.rows();
  Line line;
  line.gram = Gram(x);
  line.linear = Eigen::MatrixXd::Zero(rows(), rows());
  const Eigen::Matrix2d TC = T * C.transpose();
  line.linear.topLeftCorner(2, 2) = TC + TC.transpose();
  line.linear.topRightCorner(2, L2).noalias() = C * history_.transpose();
  line.linear.bottomLeftCorner(L2, 2) = line.linear.topRightCorner(2, L2).transpose();
  line.quadratic = Eigen::MatrixXd::Zero(rows(), rows());
  line.quadratic.topLeftCorner(2, 2) = C * C.transpose();
  return line;
}

Eigen::Matrix2Xd TrajectoryMatrix::TopRowsOfProduct(const Eigen::MatrixXd& H,
                                                    const Eigen::Matrix2Xd& x) const {
  const Eigen::Matrix2Xd T = Current(x);
  return H.topLeftCorner(2, 2) * T + H.topRightCorner(2, history_.rows()) * history_;
}

}  // namespace cohort
