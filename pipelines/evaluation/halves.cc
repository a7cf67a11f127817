#include "pipelines/evaluation/halves.h"

#include <cmath>
#include <set>
#include <vector>

#include "backend/scene/reconstruction.h"
#include "pipelines/evaluation/alignment.h"

namespace cohort {
namespace {

// Root mean square distance from their centroid.
double Extent(const std::vector<Eigen::Vector3d>& points) {
  const double n = static_cast<double>(points.size());
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : points) mean += point / n;
  double variance = 0.0;
  for (const Eigen::Vector3d& point : points) variance += (point - mean).squaredNorm() / n;
  return std::sqrt(variance);
}

}  // namespace

std::array<TrackSet, 2> SplitTracks(const TrackSet& tracks) {
  std::array<TrackSet, 2> halves;
  for (std::size_t half = 0; half < 2; ++half) {
    std::vector<Observation> observations;
    std::set<FeatureId> features;
    for (std::size_t i = half; i < tracks.features().size(); i += 2) {
      const FeatureId feature = tracks.features()[i];
      const auto track = tracks.Track(feature);
      observations.insert(observations.end(), track.begin(), track.end());
      features.insert(feature);
    }
    std::vector<TrackEnd> ends;
    for (const TrackEnd& end : tracks.ends()) {
      if (features.contains(end.feature)) ends.push_back(end);
    }
    halves[half] = TrackSet::Build(std::move(observations), std::move(ends));
  }
  return halves;
}

HalvesAgreement CompareHalves(const std::map<FrameIndex, Rigid3>& cam_from_world_a,
                              const std::map<FrameIndex, Rigid3>& cam_from_world_b,
                              std::size_t frames) {
  std::vector<Eigen::Vector3d> a;
  std::vector<Eigen::Vector3d> b;
  for (const auto& [frame, pose] : cam_from_world_a) {
    const auto other = cam_from_world_b.find(frame);
    if (other == cam_from_world_b.end()) continue;
    a.push_back(pose.Inverse().translation);
    b.push_back(other->second.Inverse().translation);
  }
  HalvesAgreement agreement;
  if (frames > 0) {
    agreement.frames_share = static_cast<double>(a.size()) / static_cast<double>(frames);
  }
  if (TooFewRegistered(cam_from_world_a.size(), frames) ||
      TooFewRegistered(cam_from_world_b.size(), frames)) {
    return agreement;
  }
  const auto rmse = AlignedRmse(a, b);
  if (rmse) agreement.disagreement = *rmse / Extent(b);
  return agreement;
}

}  // namespace cohort
