#include "pipelines/experiment/named_trackers.h"

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string_view>

#include "frontend/storage/input_record.h"
#include "frontend/track/tracker.h"
#include "pipelines/experiment/parse_unsigned.h"
#include "pipelines/json/json_file.h"
#include "pipelines/json/option_list.h"
#include "pipelines/sfm/track_sequence.h"

namespace cohort {
namespace {

using Json = nlohmann::ordered_json;

// Whether a name means something else in tables and folders.
bool IsTaken(const std::string& name) {
  if (name == "frames") return true;  // the degraded clip's folder
  try {
    NamedGridTracker(name, {}, SecondPassMode::kAuto);
    return true;
  } catch (const Error&) {
    return false;
  }
}

}  // namespace

TrackerOptions NamedTracker(const std::string& name, const TrackerOptions& base) {
  TrackerOptions options = base;
  if (name.ends_with(".json")) {
    SetFromJson(ListOptions(options), ReadJsonFile(name), name);
    InputRecord::Add(name);
    return options;
  }
  for (const auto& [text, kind] : kTrackerNames) {
    if (name == text) {
      options.tracker = kind;
      return options;
    }
  }
  if (name == "subspace-paper" || name == "descent-paper") {
    options.tracker = name == "subspace-paper" ? TrackerKind::kSubspace : TrackerKind::kDescent;
    options.subspace = PaperSubspaceOptions();
    options.measurement.enabled = false;
    return options;
  }
  const auto window_behind = [&name](std::string_view prefix) -> std::optional<unsigned> {
    if (!name.starts_with(prefix)) return std::nullopt;
    return ParseUnsigned(std::string_view(name).substr(prefix.size()));
  };
  if (const auto window = window_behind("klt")) {
    options.tracker = TrackerKind::kKlt;
    options.klt.window_px = static_cast<int>(*window);
    ValidateOptions(options);
    return options;
  }
  if (const auto window = window_behind("anchored-klt")) {
    options.tracker = TrackerKind::kAnchoredKlt;
    options.anchored_klt.window_px = static_cast<int>(*window);
    ValidateOptions(options);
    return options;
  }
  ThrowUsageError(
      "tracker '{}' is unknown: give a tracker of `cohort track`, kltN or anchored-kltN (window "
      "N px), descent-paper, subspace-paper, ceiling, sift or F.json",
      name);
}

GridTracker NamedGridTracker(const std::string& name,
                             const TrackerOptions& base,
                             SecondPassMode second_pass) {
  if (name == "ceiling") return {name, TrackSource::kCeiling, base};
  if (name == "sift") return {name, TrackSource::kSift, base};
  GridTracker tracker{"", TrackSource::kTracker, base, second_pass};
  std::string first_pass = name;
  std::string with_pass;
  for (const auto& [suffix, mode] :
       {std::pair("-refined", SecondPassMode::kOn), std::pair("-online", SecondPassMode::kOff)}) {
    if (!name.ends_with(suffix)) continue;
    first_pass = name.substr(0, name.size() - std::string_view(suffix).size());
    with_pass = suffix;
    tracker.second_pass = mode;
  }
  tracker.options = NamedTracker(first_pass, base);
  // For a file, only its name.
  const std::string stem = std::filesystem::path(first_pass).stem().string();
  if (stem != first_pass && IsTaken(stem)) {
    ThrowUsageError(
        "tracker '{}': '{}' is the name of another tracker: rename the file", name, stem);
  }
  tracker.name = stem + with_pass;
  return tracker;
}

bool HasSecondPass(const GridTracker& tracker) {
  return tracker.source == TrackSource::kTracker &&
         WantsSecondPass(tracker.second_pass, tracker.options);
}

bool IsOfFamily(std::string_view tracker, std::string_view family) {
  constexpr std::string_view kRefined = "-refined";
  if (tracker.ends_with(kRefined) != family.ends_with(kRefined)) return false;
  if (family.ends_with(kRefined)) {
    tracker.remove_suffix(kRefined.size());
    family.remove_suffix(kRefined.size());
  }
  return tracker.starts_with(family) &&
         tracker.find_first_not_of("0123456789", family.size()) == std::string_view::npos;
}

bool IsPlainKlt(const GridTracker& tracker) {
  return tracker.source == TrackSource::kTracker && IsOfFamily(tracker.name, "klt") &&
         !HasSecondPass(tracker);
}

Json OwnOptions(const GridTracker& tracker) {
  std::set<std::string> own;  // groups
  if (tracker.source == TrackSource::kTracker) {
    for (const std::string& path : OptionsReadBy(tracker.options)) {
      own.insert(path.substr(0, path.find('.')));
    }
  }
  Json kept = Json::object();
  const Json all = ToJson(tracker.options);
  for (const auto& [name, value] : all.items()) {
    const bool is_group = value.is_object() && name != "detector";
    if (!is_group || own.contains(name)) kept[name] = value;
  }
  if (tracker.source != TrackSource::kTracker) kept["tracker"] = tracker.name;
  return kept;
}

}  // namespace cohort
