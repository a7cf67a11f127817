#include "datasets/open_sequence.h"

#include <algorithm>
#include <string>
#include <system_error>
#include <vector>

#include "datasets/readers/image_folder.h"
#include "datasets/readers/video_sequence.h"
#include "frontend/core/error.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

// Returns false for a folder without read permission, such as lost+found.
bool HoldsImages(const fs::path& folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) return false;
  try {
    return !ImageNames(folder).empty();
  } catch (const Error&) {
    return false;
  }
}

[[noreturn]] void ThrowNothingRecognised(const fs::path& folder) {
  std::string looked_for;
  for (const FolderReader& reader : kFolderReaders) {
    looked_for += fmt::format("{} ({}), ", reader.mark, reader.layout);
  }
  std::vector<fs::path> below;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    below.push_back(entry->path());
  }
  std::ranges::sort(below);  // the same hint on every file system
  const auto with_images = std::ranges::find_if(below, HoldsImages);
  const std::string hint = with_images == below.end()
                               ? ""
                               : fmt::format("; there are images in {}", with_images->string());
  ThrowError("nothing to read in folder {}: no {}and no images (png, jpg, tif, pgm ...){}",
             folder.string(),
             looked_for,
             hint);
}

std::unique_ptr<Sequence> OpenFolder(const fs::path& folder,
                                     Layout layout,
                                     const FrameRange& range) {
  for (std::size_t i = 0; i < kFolderReaders.size(); ++i) {
    const FolderReader& reader = kFolderReaders[i];
    if (layout != Layout::kAuto && layout != LayoutOfReader(i)) continue;
    if (reader.recognises(folder)) return OpenImageList(reader.read(folder), range);
    if (layout == LayoutOfReader(i)) {
      ThrowError("{} is not a folder in {} layout: it has no {}",
                 folder.string(),
                 reader.layout,
                 reader.mark);
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
        "{} is a file: layout {} needs a folder", input.string(), NameOf(kLayoutNames, layout));
  }
  return OpenVideo(input, range);
}

}  // namespace cohort
