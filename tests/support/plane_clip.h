#pragma once

#include <utility>

#include "tests/support/frame_clip.h"
#include "tests/support/plane_scene.h"

namespace cohort::test {

// A clip of PlaneScene: frame i is the scene from CamFromWorld(i).
class PlaneClip : public FrameClip {
 public:
  explicit PlaneClip(int frames) : FrameClip("planes") {
    camera_ = scene_.camera();
    for (int i = 0; i < frames; ++i) {
      cv::Mat gray;
      scene_.Render(PlaneScene::CamFromWorld(i)).convertTo(gray, CV_8U, 255.0);
      cam_from_world_[Add(std::move(gray)).index] = PlaneScene::CamFromWorld(i);
    }
  }

  const PlaneScene& scene() const { return scene_; }
  cv::Mat& Picture(int frame) { return frames_[static_cast<std::size_t>(frame)].gray; }
  cv::Mat& Mask(int frame) { return frames_[static_cast<std::size_t>(frame)].mask; }

 private:
  PlaneScene scene_;
};

}  // namespace cohort::test
