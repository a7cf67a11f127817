#pragma once

#include <Eigen/Core>
#include <type_traits>

#include "frontend/track/trajectory_model/observation.h"
#include "frontend/track/trajectory_model/projection.h"

namespace cohort::trajectory_model {

// The hot loops run over all features and frames on matrices of 2 to 6 rows. With these sizes known
// at compile time, as for the ranks of nearly all scenes, the loops take a fifth of the time. R is
// the rank or Eigen::Dynamic; both share the code.
template <int R>
struct Sized {
  static constexpr int Plus(int n) { return R == Eigen::Dynamic ? Eigen::Dynamic : R + n; }
  static constexpr int MostPlus(int n) { return R == Eigen::Dynamic ? kMaxDimensions : R + n; }

  using Homogeneous = Eigen::Matrix<double, Plus(1), 1, 0, MostPlus(1), 1>;  // [1 z]
  using Unknowns = Eigen::Matrix<double, Plus(2), 1, 0, MostPlus(2), 1>;     // (z, e)
  using Information = Eigen::Matrix<double, Plus(2), Plus(2), 0, MostPlus(2), MostPlus(2)>;
  using OfZ = Eigen::Matrix<double, 2, R, 0, 2, MostPlus(0)>;
  using Coupling = Eigen::Matrix<double, 3, Plus(2), 0, 3, MostPlus(2)>;
  using Camera = Eigen::Matrix<double, 3, Plus(1), 0, 3, MostPlus(1)>;

  // Views of the state at these sizes.
  static Eigen::Map<const Camera> Of(const trajectory_model::Camera& camera) {
    return {camera.data(), 3, camera.cols()};
  }
  static Eigen::Map<const Unknowns> MeanOf(const FeaturePosterior& feature) {
    return {feature.mean.data(), feature.mean.size()};
  }
  static Eigen::Map<const Information> CovarianceOf(const FeaturePosterior& feature) {
    return {feature.covariance.data(), feature.covariance.rows(), feature.covariance.cols()};
  }
};

// Calls work(std::integral_constant<int, R>()).
template <typename Work>
decltype(auto) WithRank(int rank, const Work& work) {
  switch (rank) {
    case 2:
      return work(std::integral_constant<int, 2>());
    case 3:
      return work(std::integral_constant<int, 3>());
    case 4:
      return work(std::integral_constant<int, 4>());
    case 5:
      return work(std::integral_constant<int, 5>());
    case 6:
      return work(std::integral_constant<int, 6>());
    default:
      return work(std::integral_constant<int, Eigen::Dynamic>());
  }
}

// Project; d xy / d h = [I, -xy] / depth is computed on demand.
template <int R>
struct SizedProjection {
  Eigen::Vector2d xy;
  double inverse_depth;
  typename Sized<R>::OfZ of_z;

  Eigen::Matrix<double, 2, 3> OfHomogeneous() const {
    Eigen::Matrix<double, 2, 3> result;
    result << inverse_depth, 0.0, -xy.x() * inverse_depth,  //
        0.0, inverse_depth, -xy.y() * inverse_depth;
    return result;
  }
};

template <int R>
SizedProjection<R> ProjectSized(const Eigen::Map<const typename Sized<R>::Camera>& camera,
                                const Eigen::Map<const typename Sized<R>::Unknowns>& mean) {
  const Eigen::Index r = camera.cols() - 1;
  double h[3] = {camera(0, 0), camera(1, 0), camera(2, 0)};
  for (Eigen::Index p = 0; p < r; ++p) {
    for (int i = 0; i < 3; ++i) h[i] += camera(i, p + 1) * mean[p];
  }
  SizedProjection<R> at;
  at.inverse_depth = 1.0 / (h[2] > kLeastDepth ? h[2] : kLeastDepth);
  at.xy = {h[0] * at.inverse_depth, h[1] * at.inverse_depth};
  at.of_z.resize(2, r);
  for (Eigen::Index p = 0; p < r; ++p) {
    at.of_z(0, p) = (camera(0, p + 1) - at.xy.x() * camera(2, p + 1)) * at.inverse_depth;
    at.of_z(1, p) = (camera(1, p + 1) - at.xy.y() * camera(2, p + 1)) * at.inverse_depth;
  }
  return at;
}

template <int R>
Eigen::Vector2d SizedResidual(const SizedProjection<R>& at,
                              const Observation& o,
                              const Eigen::Map<const typename Sized<R>::Unknowns>& mean) {
  const Eigen::Vector2d d = o.xy - at.xy;
  return o.anchor ? d : d - Eigen::Vector2d(mean[mean.size() - 2], mean[mean.size() - 1]);
}

// J cov(z, e) J', J = [d xy / d z, I]. The I is omitted for a position that is not a measurement or
// is the anchor's own.
template <int R>
Eigen::Matrix2d CovarianceOfPosition(
    const typename Sized<R>::OfZ& of_z,
    const Eigen::Map<const typename Sized<R>::Information>& covariance,
    bool with_anchor_error) {
  const Eigen::Index r = of_z.cols();
  const typename Sized<R>::OfZ with_z = of_z.lazyProduct(covariance.topLeftCorner(r, r));
  Eigen::Matrix2d result = with_z.lazyProduct(of_z.transpose());
  if (with_anchor_error) {
    const Eigen::Matrix2d cross = of_z.lazyProduct(covariance.topRightCorner(r, 2));
    result += cross + cross.transpose() + covariance.template bottomRightCorner<2, 2>();
  }
  return result;
}

}  // namespace cohort::trajectory_model
