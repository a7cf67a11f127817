#include "pipelines/evaluation/point_error.h"

namespace cohort {

std::vector<double> PointErrors(const Reconstruction& reconstruction,
                                const Sim3& truth_from_reconstruction,
                                const PointTruth& truth) {
  std::vector<double> errors;
  for (const auto& [feature, point] : reconstruction.points) {
    if (point.views.empty()) continue;
    const PointView& first = point.views.front();
    const auto true_point = truth(first.frame, first.xy);
    if (!true_point) continue;
    errors.push_back((truth_from_reconstruction * point.in_world - *true_point).norm());
  }
  return errors;
}

}  // namespace cohort
