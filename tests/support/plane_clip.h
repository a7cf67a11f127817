#pragma once

#include <map>
#include <string>
#include <vector>

#include "datasets/readers/sequence.h"
#include "tests/support/plane_scene.h"

namespace cohort::test {

// A clip of PlaneScene that is never on disk: frame i is the scene from CamFromWorld(i).
class PlaneClip : public Sequence {
 public:
  explicit PlaneClip(int frames) {
    for (int i = 0; i < frames; ++i) {
      Frame& frame = frames_.emplace_back();
      frame.index = FrameIndex{static_cast<std::uint32_t>(i)};
      frame.name = std::to_string(i) + ".png";
      scene_.Render(PlaneScene::CamFromWorld(i)).convertTo(frame.gray, CV_8U, 255.0);
      cam_from_world_[frame.index] = PlaneScene::CamFromWorld(i);
    }
  }

  const PlaneScene& scene() const { return scene_; }
  cv::Mat& Picture(int frame) { return frames_[static_cast<std::size_t>(frame)].gray; }

  std::optional<Frame> Next() override {
    if (next_ == frames_.size()) return std::nullopt;
    return frames_[next_++];
  }
  void Rewind() override { next_ = 0; }
  std::string Name() const override { return "planes"; }
  std::filesystem::path ImageRoot() const override { return {}; }
  std::optional<std::size_t> FrameCount() const override { return frames_.size(); }
  std::optional<Camera> KnownCamera() const override { return scene_.camera(); }
  const std::map<FrameIndex, Rigid3>& TrueCamFromWorld() const override { return cam_from_world_; }
  std::optional<cv::Mat> TrueDepth(FrameIndex) const override { return std::nullopt; }
  std::optional<cv::Mat> OccluderMask(FrameIndex) const override { return std::nullopt; }
  const std::string& Warning() const override { return warning_; }

 private:
  PlaneScene scene_;
  std::vector<Frame> frames_;
  std::map<FrameIndex, Rigid3> cam_from_world_;
  std::string warning_;
  std::size_t next_ = 0;
};

}  // namespace cohort::test
