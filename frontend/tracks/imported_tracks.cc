#include "frontend/tracks/imported_tracks.h"

#include <charconv>
#include <cstdint>
#include <filesystem>
#include <utility>

#include "frontend/core/error.h"

namespace cohort {
namespace fs = std::filesystem;

FrameNames::FrameNames(std::span<const FrameInfo> frames) {
  const auto add = [](ByName& names, const std::string& name, FrameIndex frame) {
    const auto [at, is_new] = names.emplace(name, frame);
    if (!is_new) at->second.reset();
  };
  for (const FrameInfo& frame : frames) {
    const fs::path name = frame.name;
    add(by_name_, name.string(), frame.index);
    add(by_last_part_, name.filename().string(), frame.index);
    add(by_stem_, name.stem().string(), frame.index);
  }
}

std::optional<FrameIndex> FrameNames::Find(const std::string& name) {
  const fs::path path = name;
  const std::pair<const ByName*, std::string> ways[] = {{&by_name_, path.string()},
                                                        {&by_last_part_, path.filename().string()},
                                                        {&by_stem_, path.stem().string()}};
  for (const auto& [names, key] : ways) {
    const auto found = names->find(key);
    if (found == names->end() || !found->second) continue;
    const std::string& before = found_.emplace(*found->second, name).first->second;
    if (before != name) {
      ThrowError(
          "the names of images {} and {} both match frame {} of the clip: give images with "
          "distinct names",
          before,
          name,
          ToInt(*found->second));
    }
    return found->second;
  }
  return std::nullopt;
}

bool CountsFromOne(const std::string& unknown_name,
                   const TrackSet& tracks,
                   std::span<const FrameInfo> frames) {
  if (frames.empty() || !tracks.InFrame(frames.front().index).empty()) return false;
  // The prefix of a name, and the number at its end.
  const auto split = [](const std::string& name) {
    const std::string stem = fs::path(name).stem().string();
    const std::size_t digits = stem.find_last_not_of("0123456789") + 1;
    std::uint64_t number = 0;
    std::from_chars(stem.data() + digits, stem.data() + stem.size(), number);
    return std::pair(stem.substr(0, digits), number);
  };
  const auto [prefix, number] = split(unknown_name);
  const auto [last_prefix, last] = split(frames.back().name);
  return prefix == last_prefix && number == last + 1;
}

void CheckSomeImageKnown(const ImportedTracks& imported,
                         const std::string& path,
                         std::span<const FrameInfo> frames) {
  if (imported.unknown_images == 0 || !imported.tracks.observations().empty()) return;
  ThrowError("{}: none of its {} images is a frame of the clip: it has {}, but the clip has {}",
             path,
             imported.unknown_images,
             imported.an_unknown_image,
             frames.empty() ? "none" : frames.front().name);
}

}  // namespace cohort
