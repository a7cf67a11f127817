#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string_view>

#include "datasets/readers/euroc.h"
#include "datasets/readers/kitti.h"
#include "datasets/readers/sequence.h"
#include "datasets/readers/tum.h"
#include "frontend/core/options.h"

namespace cohort {

// A folder layout of input, and its reader.
struct FolderReader {
  std::string_view layout;  // its name, as --layout takes it
  std::string_view mark;    // the file or folder that identifies it
  bool (*recognises)(const std::filesystem::path& folder);
  ImageList (*read)(const std::filesystem::path& folder);
};

// The readers, in the order in which they are tried. A new reader needs only a line here: --layout,
// the recognition and the error message for an unknown folder follow from it.
inline constexpr auto kFolderReaders = std::to_array<FolderReader>({
    {"tum", kTumMark, IsTum, ReadTum},
    {"euroc", kEurocMark, IsEuroc, ReadEuroc},
    {"kitti", kKittiMark, IsKitti, ReadKitti},
});

// The layout of the input. Values from kFirstFolder on count through kFolderReaders.
enum class Layout : std::uint8_t { kAuto, kVideo, kImages, kFirstFolder };

constexpr Layout LayoutOfReader(std::size_t i) {
  return static_cast<Layout>(static_cast<std::size_t>(Layout::kFirstFolder) + i);
}

inline constexpr std::size_t kLayouts = 3 + kFolderReaders.size();
constexpr ChoiceNames<Layout, kLayouts> NamesOfLayouts() {
  ChoiceNames<Layout, kLayouts> names{
      {{"auto", Layout::kAuto}, {"video", Layout::kVideo}, {"images", Layout::kImages}}};
  for (std::size_t i = 0; i < kFolderReaders.size(); ++i) {
    names[3 + i] = {kFolderReaders[i].layout, LayoutOfReader(i)};
  }
  return names;
}
inline constexpr auto kLayoutNames = NamesOfLayouts();

// Opens a video file, an image folder, a glob of images, or a folder in one of the layouts above
// (datasets/README.md). Throws Error that lists what was looked for.
std::unique_ptr<Sequence> OpenSequence(const std::filesystem::path& input,
                                       Layout layout = Layout::kAuto,
                                       const FrameRange& range = {});

}  // namespace cohort
