#include "pipelines/sfm/idle_options.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

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

std::string DescribeUnread(const std::vector<std::string>& idle, const std::string& who) {
  if (idle.empty()) return "";
  return fmt::format("{} does not use {}: {} no effect",
                     who,
                     fmt::join(idle, ", "),
                     idle.size() == 1 ? "it has" : "they have");
}

}  // namespace

std::string DescribeIdleOptions(const TrackerOptions& options) {
  const std::set<std::string> read = OptionsReadBy(options);
  const auto is_read = [&read](const std::string& path) {
    return read.contains(GroupOf(path)) || read.contains(path);
  };
  std::vector<std::string> idle;
  for (const std::string& path : ChangedOptions(options)) {
    const std::string group = GroupOf(path);
    if (!group.empty() && group != "detector" && !is_read(path)) idle.push_back(path);
  }
  // --window sets both, for whichever tracker reads one.
  if (is_read("klt.window_px") || is_read("subspace.template_px")) {
    std::erase_if(idle, [&options](const std::string& path) {
      return (path == "klt.window_px" || path == "subspace.template_px") &&
             options.klt.window_px == options.subspace.template_px;
    });
  }
  const bool is_alone = options.tracker == TrackerKind::kSubspace && !read.contains("subspace");
  return DescribeUnread(idle,
                        fmt::format("tracker {}{}",
                                    NameOf(kTrackerNames, options.tracker),
                                    is_alone ? " without a penalty" : ""));
}

std::string DescribeIdleOptions(const ReconstructOptions& options) {
  if (options.backend != BackendKind::kCeres) return "";
  std::vector<std::string> idle = ChangedOptions(options);
  std::erase_if(idle, [](const std::string& path) {
    const std::string group = GroupOf(path);
    return group == "ceres" || path == "backend";
  });
  return DescribeUnread(idle, "backend ceres");
}

}  // namespace cohort
