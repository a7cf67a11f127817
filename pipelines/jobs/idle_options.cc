#include "pipelines/jobs/idle_options.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <set>
#include <string>
#include <vector>

#include "frontend/track/tracker.h"
#include "pipelines/json/option_list.h"

namespace cohort {
namespace {

std::string GroupOf(const std::string& path) {
  const std::size_t dot = path.find('.');
  return dot == std::string::npos ? "" : path.substr(0, dot);
}

void WarnOfUnread(const std::vector<std::string>& idle, const std::string& who) {
  if (idle.empty()) return;
  spdlog::warn("{} does not use {}: {} no effect",
               who,
               fmt::join(idle, ", "),
               idle.size() == 1 ? "it has" : "they have");
}

}  // namespace

void WarnOfIdleOptions(const TrackerOptions& options) {
  const std::set<std::string> own = OptionGroupsOf(options.tracker);
  // Of all features together, which a descent of each alone has not.
  const std::set<std::string> joint = {"subspace.constraint",
                                       "subspace.penalty",
                                       "subspace.uncentered",
                                       "subspace.penalty_weight",
                                       "subspace.epsilon",
                                       "measurement.enabled",
                                       "measurement.max_rank",
                                       "measurement.perspective",
                                       "measurement.max_unexplained_frames",
                                       "measurement.fuse"};
  std::vector<std::string> idle;
  for (const std::string& path : ChangedOptions(options)) {
    const std::string group = GroupOf(path);
    if (group.empty() || group == "detector") continue;
    const bool is_alone = options.tracker == TrackerKind::kDescent && joint.contains(path);
    if (!own.contains(group) || is_alone) idle.push_back(path);
  }
  // --window sets both, for whichever tracker reads one.
  if (own.contains("klt") || own.contains("subspace")) {
    std::erase_if(idle, [&options](const std::string& path) {
      return (path == "klt.window_px" || path == "subspace.template_px") &&
             options.klt.window_px == options.subspace.template_px;
    });
  }
  WarnOfUnread(idle, fmt::format("tracker {}", NameOf(kTrackerNames, options.tracker)));
}

void WarnOfIdleOptions(const ReconstructOptions& options) {
  if (options.backend != BackendKind::kCeres) return;
  std::vector<std::string> idle = ChangedOptions(options);
  std::erase_if(idle, [](const std::string& path) {
    const std::string group = GroupOf(path);
    return group == "ceres" || path == "backend";
  });
  WarnOfUnread(idle, "backend ceres");
}

}  // namespace cohort
