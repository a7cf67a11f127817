#include "pipelines/experiment/undegraded.h"

#include <nlohmann/json.hpp>
#include <vector>

#include "backend/colmap/model_io.h"
#include "datasets/readers/sequence.h"
#include "pipelines/evaluation/alignment.h"
#include "pipelines/json/json_file.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Centres = std::map<std::uint32_t, Eigen::Vector3d>;  // by position in the clip

struct Poses {
  FrameRange range;
  std::map<FrameIndex, Rigid3> cam_from_world;

  // nullopt for a frame outside the range.
  std::optional<std::uint32_t> PlaceOf(FrameIndex frame) const {
    const std::uint32_t i = ToInt(frame);
    if (i < range.first || (i - range.first) % range.stride != 0) return std::nullopt;
    return (i - range.first) / range.stride;
  }
};

// Returns nullopt if there is no model to compare.
std::optional<Poses> ReadPoses(const fs::path& folder) {
  const fs::path summary = folder / "summary.json";
  if (!fs::exists(summary) || !fs::exists(folder / "images.bin")) return std::nullopt;
  std::optional<FrameRange> range;
  UseJsonFile(summary, [&range](const nlohmann::ordered_json& json) {
    if (json.at("failed").get<bool>()) return;
    range = FrameRange::Parse(json.at("frame_range").get<std::string>());
  });
  if (!range) return std::nullopt;
  return Poses{*range, ReadReconstruction(folder).cam_from_world};
}

Centres CentresOf(const Poses& poses, const std::map<FrameIndex, Rigid3>& cam_from_world) {
  Centres centres;
  for (const auto& [frame, pose] : cam_from_world) {
    const auto place = poses.PlaceOf(frame);
    if (place) centres[*place] = pose.Inverse().translation;
  }
  return centres;
}

struct Paired {
  std::vector<Eigen::Vector3d> source;
  std::vector<Eigen::Vector3d> target;
};
Paired Pair(const Centres& source, const Centres& target) {
  Paired paired;
  for (const auto& [place, centre] : source) {
    const auto it = target.find(place);
    if (it == target.end()) continue;
    paired.source.push_back(centre);
    paired.target.push_back(it->second);
  }
  return paired;
}

}  // namespace

std::optional<double> ErrorToUndegraded(const fs::path& model,
                                        const fs::path& reference,
                                        const std::map<FrameIndex, Rigid3>& true_cam_from_world) {
  const auto dark = ReadPoses(model);
  const auto light = ReadPoses(reference);
  if (!dark || !light) return std::nullopt;
  Centres reference_centres = CentresOf(*light, light->cam_from_world);
  const Paired with_truth = Pair(reference_centres, CentresOf(*light, true_cam_from_world));
  const auto metric = AlignPoints(with_truth.source, with_truth.target, AlignmentScale::kEstimated);
  if (!metric) return std::nullopt;
  for (auto& [place, centre] : reference_centres) centre = *metric * centre;

  const Paired paired = Pair(CentresOf(*dark, dark->cam_from_world), reference_centres);
  return AlignedRmse(paired.source, paired.target);
}

}  // namespace cohort
