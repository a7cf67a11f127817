#include "datasets/image_folder.h"
#include "datasets/sequence.h"
#include "frontend/core/error.h"

namespace cohort {

std::unique_ptr<Sequence> OpenSequence(const std::filesystem::path& input,
                                       Layout /*layout*/,
                                       const FrameRange& range) {
  if (!std::filesystem::exists(input) && !IsGlob(input.string())) {
    ThrowError("no such file or folder: {}", input.string());
  }
  return OpenImageList(ListImageFolder(input), range);
}

}  // namespace cohort
