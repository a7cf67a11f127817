#include "datasets/open_sequence.h"

#include <string>
#include <system_error>

#include "datasets/readers/image_folder.h"
#include "datasets/readers/video_sequence.h"
#include "frontend/core/error.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void ThrowNothingRecognised(const fs::path& folder) {
  std::string looked_for;
  for (const FolderReader& reader : kFolderReaders) {
    looked_for += fmt::format("{} ({}), ", reader.mark, reader.layout);
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
  for (std::size_t i = 0; i < kFolderReaders.size(); ++i) {
    const FolderReader& reader = kFolderReaders[i];
    if (layout != Layout::kAuto && layout != LayoutOfReader(i)) continue;
    if (reader.recognises(folder)) return OpenImageList(reader.read(folder), range);
    if (layout == LayoutOfReader(i)) {
      ThrowError("{} is no folder in {} layout: it has no {}",
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
        "{} is a file: layout {} wants a folder", input.string(), NameOf(kLayoutNames, layout));
  }
  return OpenVideo(input, range);
}

}  // namespace cohort
