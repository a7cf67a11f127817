#include "frontend/energy/total_energy.h"

#include <Eigen/Eigenvalues>
#include <utility>

#include "frontend/energy/patch_energy.h"

namespace cohort {

TotalEnergy::TotalEnergy(const cv::Mat& picture,
                         std::span<const float* const> patches,
                         int n,
                         Eigen::VectorXd data_weights,
                         const TrajectoryMatrix* trajectories,
                         const Penalty* penalty)
    : picture_(&picture),
      patches_(patches),
      n_(n),
      data_weights_(std::move(data_weights)),
      trajectories_(trajectories),
      penalty_(penalty) {
  Check(data_weights_.size() == features(), "one weight a feature");
  Check((trajectories == nullptr) == (penalty == nullptr), "a penalty needs trajectories");
}

std::span<const float> TotalEnergy::patch(Eigen::Index f) const {
  return {patches_[static_cast<std::size_t>(f)], static_cast<std::size_t>(n_) * n_};
}

double TotalEnergy::PenaltyOf(const Eigen::MatrixXd& gram) const {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(gram, Eigen::EigenvaluesOnly);
  return penalty_->Value(eigen.eigenvalues());
}

double TotalEnergy::DataValue(const Eigen::Matrix2Xd& x) const {
  double sum = 0.0;
  for (Eigen::Index f = 0; f < features(); ++f) {
    if (data_weights_[f] == 0.0) continue;
    sum += data_weights_[f] * PatchEnergy(*picture_, x.col(f), patch(f), n_);
  }
  return sum;
}

double TotalEnergy::Value(const Eigen::Matrix2Xd& x) const {
  const double data = DataValue(x);
  return penalty_ == nullptr ? data : data + PenaltyOf(trajectories_->Gram(x));
}

Eigen::Matrix2Xd TotalEnergy::Gradient(const Eigen::Matrix2Xd& x) const {
  Eigen::Matrix2Xd gradient = Eigen::Matrix2Xd::Zero(2, features());
  for (Eigen::Index f = 0; f < features(); ++f) {
    if (data_weights_[f] == 0.0) continue;
    gradient.col(f) =
        data_weights_[f] * PatchEnergyGradient(*picture_, x.col(f), patch(f), n_).gradient;
  }
  if (penalty_ == nullptr) return gradient;
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(trajectories_->Gram(x));
  const Eigen::VectorXd h = penalty_->Weights(eigen.eigenvalues());
  const Eigen::MatrixXd& U = eigen.eigenvectors();
  return gradient + trajectories_->TopRowsOfProduct(U * h.asDiagonal() * U.transpose(), x);
}

TotalEnergy::Line TotalEnergy::Along(const Eigen::Matrix2Xd& x, const Eigen::Matrix2Xd& c) const {
  Line line;
  line.energy_ = this;
  line.x_ = x;
  line.c_ = c;
  if (penalty_ != nullptr) line.gram_ = trajectories_->AlongLine(x, c);
  return line;
}

double TotalEnergy::Line::operator()(double d) const {
  const double data = energy_->DataValue(x_ + d * c_);
  return energy_->penalty_ == nullptr ? data : data + energy_->PenaltyOf(gram_.At(d));
}

}  // namespace cohort
