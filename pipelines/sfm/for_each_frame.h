#pragma once

#include <optional>
#include <span>
#include <string_view>

#include "pipelines/sfm/input.h"
#include "pipelines/sfm/progress.h"
#include "pipelines/sfm/read_ahead.h"

namespace cohort {

// Calls `use` with these frames of the clip that `file` was made from, which is rewound. Throws
// Error if the clip lacks one of them, or has it in another size.
template <typename Use>
void ForEachFrame(const TrackFile& file,
                  std::span<const FrameInfo> frames,
                  Sequence& sequence,
                  std::string_view stage,
                  const StageProgress& progress,
                  const Use& use) {
  sequence.Rewind();
  ReadAhead ahead(sequence);
  std::size_t done = 0;
  if (progress) progress(stage, done, frames.size());
  std::optional<Frame> frame = ahead.Next();
  for (const FrameInfo& wanted : frames) {
    while (frame && frame->index < wanted.index) frame = ahead.Next();
    if (!frame || frame->index != wanted.index) {
      ThrowError("{}: has no frame {} ({}), which the tracks were made from: give the same clip",
                 sequence.Name(),
                 ToInt(wanted.index),
                 wanted.name);
    }
    CheckPictureSize(file, *frame, sequence.Name());
    if (&wanted != &frames.back()) ahead.Begin();
    use(*frame);
    if (progress) progress(stage, ++done, frames.size());
  }
}

// All frames of the tracks.
template <typename Use>
void ForEachFrame(const TrackFile& file,
                  Sequence& sequence,
                  std::string_view stage,
                  const StageProgress& progress,
                  const Use& use) {
  ForEachFrame(file, file.frames, sequence, stage, progress, use);
}

}  // namespace cohort
