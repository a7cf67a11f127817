#pragma once

#include <optional>

#include "tests/support/frame_clip.h"
#include "tests/support/hard_clips.h"

namespace cohort::test {

// Pictures as a clip.
class PictureClip : public FrameClip {
 public:
  explicit PictureClip(const Pictures& pictures, const std::optional<Camera>& camera = std::nullopt)
      : FrameClip("hard") {
    camera_ = camera;
    for (const cv::Mat& picture : pictures) Add(picture);
  }

  cv::Mat& Mask(int frame) { return frames_[static_cast<std::size_t>(frame)].mask; }
};

}  // namespace cohort::test
