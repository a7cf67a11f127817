#pragma once

#include <filesystem>
#include <memory>

#include "datasets/readers/sequence.h"

namespace cohort {

// Opens a video file through FFmpeg (VideoDecoder), decoded frame by frame to 8-bit grey. Frame i
// has the file's time, from 0 on, and the name NumberedFrameName. A file that ends before its
// header's count (truncated, damaged) gives all its decodable frames and a Warning(). Throws Error
// if it is not a video, no frame can be decoded, or the range starts after the last one.
std::unique_ptr<Sequence> OpenVideo(const std::filesystem::path& file, const FrameRange& range);

}  // namespace cohort
