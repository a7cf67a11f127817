#include <array>
#include <system_error>

#include "datasets/readers/euroc.h"
#include "datasets/readers/image_folder.h"
#include "datasets/readers/kitti.h"
#include "datasets/readers/sequence.h"
#include "datasets/readers/tum.h"
#include "datasets/readers/video_sequence.h"
#include "frontend/core/error.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

struct FolderLayout {
  Layout layout;
  const char* mark;  // what it is recognised by
  bool (*is)(const fs::path&);
  ImageList (*read)(const fs::path&);
};
constexpr std::array<FolderLayout, 3> kFolderLayouts{
    {{Layout::kTum, kTumMark, IsTum, ReadTum},
     {Layout::kEuroc, kEurocMark, IsEuroc, ReadEuroc},
     {Layout::kKitti, kKittiMark, IsKitti, ReadKitti}}};

[[noreturn]] void ThrowNothingRecognised(const fs::path& folder) {
  std::string looked_for;
  for (const FolderLayout& candidate : kFolderLayouts) {
    looked_for += fmt::format("{} ({}), ", candidate.mark, NameOf(kLayoutNames, candidate.layout));
  }
  std::string hint;
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder, error)) {
    if (entry.is_directory(error) && !ImageNames(entry.path()).empty()) {
      hint = fmt::format("; there are images in {}", entry.path().string());
      break;
    }
  }
  ThrowError("nothing to read in folder {}: no {}and no images (png, jpg, tif, pgm ...){}",
             folder.string(),
             looked_for,
             hint);
}

std::unique_ptr<Sequence> OpenFolder(const fs::path& folder,
                                     Layout layout,
                                     const FrameRange& range) {
  for (const FolderLayout& candidate : kFolderLayouts) {
    if (layout != Layout::kAuto && layout != candidate.layout) continue;
    if (candidate.is(folder)) return OpenImageList(candidate.read(folder), range);
    if (layout == candidate.layout) {
      ThrowError("{} is no folder in {} layout: it has no {}",
                 folder.string(),
                 NameOf(kLayoutNames, layout),
                 candidate.mark);
    }
  }
  if (layout == Layout::kVideo) ThrowError("{} is a folder: give a video file", folder.string());
  if (layout == Layout::kAuto && ImageNames(folder).empty()) ThrowNothingRecognised(folder);
  return OpenImageList(ListImageFolder(folder), range);
}

}  // namespace

std::unique_ptr<Sequence> OpenSequence(const fs::path& input,
                                       Layout layout,
                                       const FrameRange& range) {
  std::error_code error;
  if (fs::is_directory(input, error)) return OpenFolder(input, layout, range);
  if (!fs::exists(input, error)) {
    if (IsGlob(input.string())) return OpenImageList(ListImageFolder(input), range);
    ThrowError("no such file or folder: {}", input.string());
  }
  if (layout == Layout::kImages || (layout == Layout::kAuto && IsImageFile(input))) {
    return OpenImageList(ListImageFolder(input), range);
  }
  if (layout != Layout::kAuto && layout != Layout::kVideo) {
    ThrowError(
        "{} is a file: layout {} wants a folder", input.string(), NameOf(kLayoutNames, layout));
  }
  return OpenVideo(input, range);
}

}  // namespace cohort
