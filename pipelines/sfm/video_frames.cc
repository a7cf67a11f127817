#include "pipelines/sfm/video_frames.h"

#include <string>
#include <vector>

#include "datasets/open_sequence.h"
#include "datasets/readers/video_sequence.h"
#include "frontend/core/error.h"
#include "frontend/core/output.h"
#include "frontend/image/write_image.h"

namespace cohort {

namespace {

// Those of the tracks, and those that other tracks of the video have left.
std::vector<std::string> OwnNames(const TrackFile& file, const std::filesystem::path& folder) {
  std::vector<std::string> names;
  for (const FrameInfo& frame : file.frames) names.push_back(frame.name);
  if (!std::filesystem::is_directory(folder)) return names;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (IsVideoFrameName(name)) names.push_back(name);
  }
  return names;
}

}  // namespace

void WriteVideoFrames(const TrackFile& file,
                      const std::filesystem::path& folder,
                      const StageProgress& progress) {
  constexpr const char* kWithout = "`cohort reconstruct --no-write-frames` needs no pictures";
  if (!std::filesystem::exists(file.source)) {
    ThrowError(
        "{}: the video that the tracks are of is not there any more: {}", file.source, kWithout);
  }
  OutputFolder out(folder, OwnNames(file, folder));
  const auto video = OpenSequence(file.source, Layout::kVideo);
  std::size_t done = 0;
  for (const FrameInfo& wanted : file.frames) {
    std::optional<Frame> frame = video->Next();
    while (frame && frame->index < wanted.index) frame = video->Next();
    if (!frame || frame->name != wanted.name) {
      ThrowError("{}: has no frame {} any more: track the video again ({})",
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
