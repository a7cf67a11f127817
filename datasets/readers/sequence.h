#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "datasets/readers/focal_guess.h"
#include "frontend/geometry/camera.h"
#include "frontend/geometry/rigid3.h"
#include "frontend/image/frame.h"

namespace cohort {

// Frames first, first + stride, ... up to but without end; an unset end means the whole clip.
struct FrameRange {
  std::uint32_t first = 0;
  std::optional<std::uint32_t> end;
  std::uint32_t stride = 1;

  // Text A:B or A:B:STEP like Python's slices; A and B may be left out, as in "100:" or "::5".
  // Throws UsageError.
  static FrameRange Parse(const std::string& text);
  // How many frames of a source of `source_frames` are in the range.
  std::size_t Count(std::size_t source_frames) const;
};

// Frames in order, decoded one at a time: an hour of video needs the memory of a few frames.
//
//   auto sequence = OpenSequence("clip.mp4");
//   while (auto frame = sequence->Next()) Use(*frame);
//   if (!sequence->Warning().empty()) Tell(sequence->Warning());
class Sequence {
 public:
  virtual ~Sequence() = default;

  // The next frame of the range; nullopt at the end. Throws Error naming the file if a frame has
  // another size, and SystemError if the system does not give access to an existing file. A file
  // that cannot be decoded ends the sequence: Warning() then names it and the reason.
  virtual std::optional<Frame> Next() = 0;
  virtual void Rewind() = 0;
  // Whether Rewind works: not for frames that are given one by one and not kept.
  virtual bool CanRewind() const { return true; }
  // Whether another thread may call Next, one at a time. False if Next runs foreign code.
  virtual bool AnyThreadMayRead() const { return true; }

  virtual std::string Name() const = 0;  // for tables: the folder's or file's name
  // The files that the frames and their times are read from, including those outside the range;
  // empty if the frames come from elsewhere.
  virtual std::vector<std::filesystem::path> Files() const { return {}; }
  // Frame names are relative to it; empty for a video.
  virtual std::filesystem::path ImageRoot() const = 0;
  // Frames of the range. A video's count is its header's until its end is reached.
  virtual std::optional<std::size_t> FrameCount() const = 0;
  virtual std::optional<Camera> KnownCamera() const = 0;  // calibration in the layout
  // The files' guess for a camera without calibration (EXIF, metadata of a video), if any.
  virtual std::optional<FocalGuess> FocalGuessOfFile() const { return std::nullopt; }
  // The direction of the sensor's later rows in the pictures.
  virtual RowOrder SensorRows() const { return RowOrder::kDown; }
  // True poses by frame of the source, if the layout has them (nearest time stamp within 20 ms);
  // may be empty.
  virtual const std::map<FrameIndex, Rigid3>& TrueCamFromWorld() const = 0;
  // Depth along the optical axis [m], CV_32FC1, 0 where unknown; nullopt if the layout has none.
  virtual std::optional<cv::Mat> TrueDepth(FrameIndex frame) const = 0;
  // CV_8UC1, 255 where a foreground occluder of `degrade` covers the scene; nullopt without one.
  virtual std::optional<cv::Mat> OccluderMask(FrameIndex frame) const = 0;
  virtual const std::string& Warning() const = 0;  // empty if there is none
};

}  // namespace cohort
