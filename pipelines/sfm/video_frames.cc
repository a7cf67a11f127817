#include "pipelines/sfm/video_frames.h"

#include <opencv2/imgcodecs.hpp>
#include <set>
#include <string>

#include "datasets/open_sequence.h"
#include "frontend/core/error.h"
#include "frontend/image/write_image.h"
#include "frontend/storage/output.h"
#include "frontend/tracks/frame_name.h"

namespace cohort {
namespace {

// Whether the pictures are grey, as we write them; pictures that other programs extract from a
// video have colours.
bool AreGray(const std::filesystem::path& folder) {
  for (const auto& picture : std::filesystem::directory_iterator(folder)) {
    const cv::Mat read = cv::imread(picture.path().string(), cv::IMREAD_UNCHANGED);
    return read.empty() || read.channels() == 1;
  }
  return true;
}

}  // namespace

void WriteVideoFrames(const TrackFile& file,
                      const std::filesystem::path& folder,
                      const StageProgress& progress) {
  constexpr const char* kWithout =
      "--no-write-frames (for sfm --no-model.write-frames) needs no pictures";
  if (!std::filesystem::exists(file.source)) {
    ThrowError(
        "{}: the video that the tracks were made from no longer exists: {}", file.source, kWithout);
  }
  std::set<std::string> names;
  for (const FrameInfo& frame : file.frames) names.insert(frame.name);
  // Also accepts the pictures that other tracks of the video have left.
  OutputFolder out(
      folder,
      [&names](const std::string& name) {
        return names.contains(name) || IsNumberedFrameName(name);
      },
      AreGray);
  const auto video = OpenSequence(file.source, Layout::kVideo);
  std::size_t done = 0;
  for (const FrameInfo& wanted : file.frames) {
    std::optional<Frame> frame = video->Next();
    while (frame && frame->index < wanted.index) frame = video->Next();
    if (!frame || frame->name != wanted.name) {
      ThrowError("{}: no longer has frame {}: track the video again ({})",
                 file.source,
                 wanted.name,
                 kWithout);
    }
    WriteImage(out.partial() / wanted.name, frame->gray);
    if (progress) progress("write frames", ++done, file.frames.size());
  }
  out.Commit();
}

}  // namespace cohort
