#include "pipelines/evaluation/halves.h"

#include <set>
#include <vector>

#include "backend/scene/reconstruction.h"
#include "pipelines/evaluation/alignment.h"

namespace cohort {

std::array<TrackSet, 2> SplitTracks(const TrackSet& tracks) {
  std::array<std::set<FeatureId>, 2> features;
  for (std::size_t i = 0; i < tracks.features().size(); ++i) {
    features[i % 2].insert(tracks.features()[i]);
  }
  std::array<TrackSet, 2> halves;
  for (std::size_t half = 0; half < 2; ++half) {
    halves[half] = tracks.Select([&](FeatureId f) { return features[half].contains(f); });
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
