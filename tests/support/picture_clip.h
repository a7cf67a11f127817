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
};

}  // namespace cohort::test
