#include "pipelines/sfm/summary_json.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <string>

namespace cohort {
namespace {

// "first:end:stride", as FrameRange reads it: evaluation must know which frames are missing.
std::string RangeOf(const std::vector<FrameInfo>& frames) {
  if (frames.empty()) return "0:0";
  const std::uint32_t first = ToInt(frames.front().index);
  const std::uint32_t stride = frames.size() > 1 ? ToInt(frames[1].index) - first : 1;
  return fmt::format("{}:{}:{}", first, ToInt(frames.back().index) + 1, stride);
}

}  // namespace

nlohmann::ordered_json SummaryToJson(const ReconstructionSummary& summary,
                                     const std::vector<FrameInfo>& frames) {
  return {{"registered", summary.registered},
          {"frames", summary.frames},
          {"frame_range", RangeOf(frames)},
          {"failed", summary.Failed()},
          {"points", summary.points},
          {"observations", summary.observations},
          {"mean_track_length", summary.mean_track_length},
          {"mean_reprojection_px", summary.mean_reprojection_px},
          {"seconds", summary.seconds},
          {"termination", summary.termination}};
}

}  // namespace cohort
