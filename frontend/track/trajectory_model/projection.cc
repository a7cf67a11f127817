#include "frontend/track/trajectory_model/projection.h"

#include <algorithm>

namespace cohort::trajectory_model {

Projection Project(const Camera& camera, const Vector& z) {
  const Eigen::Index r = camera.cols() - 1;
  Eigen::Vector3d h = camera.col(0) + camera.rightCols(r) * z.head(r);
  const double depth = std::max(h.z(), kLeastDepth);
  Projection projection;
  projection.xy = h.head<2>() / depth;
  // xy = (h_1, h_2) / h_3, so d xy / d h = [I, -xy] / h_3.
  projection.of_homogeneous << Eigen::Matrix2d::Identity() / depth, -projection.xy / depth;
  projection.of_z = projection.of_homogeneous * camera.rightCols(r);  // d h / d z = [B; c']
  return projection;
}

Eigen::Vector2d Residual(const Projection& projection,
                         const Observation& o,
                         const FeaturePosterior& feature) {
  Eigen::Vector2d d = o.xy - projection.xy;
  if (!o.anchor) d -= feature.mean.tail<2>();
  return d;
}

void FixCameraGauge(bool perspective, Eigen::Ref<Eigen::MatrixXd> normal) {
  // vec(C) is column-major: entry 3 p + 2 is C's last row in column p. It is fixed by so much
  // information that its step is negligible.
  const double much = 1e6 * normal.trace() + 1.0;
  normal(2, 2) += much;
  if (perspective) return;
  for (Eigen::Index p = 1; 3 * p < normal.rows(); ++p) normal(3 * p + 2, 3 * p + 2) += much;
}

}  // namespace cohort::trajectory_model
