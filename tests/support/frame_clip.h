#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "datasets/readers/sequence.h"

namespace cohort::test {

// Frames as a clip that is never on disk. Who derives from it fills in what it has.
class FrameClip : public Sequence {
 public:
  std::optional<Frame> Next() override {
    if (next_ == frames_.size()) return std::nullopt;
    return frames_[next_++];
  }
  void Rewind() override { next_ = 0; }
  std::string Name() const override { return name_; }
  std::filesystem::path ImageRoot() const override { return {}; }
  std::optional<std::size_t> FrameCount() const override { return frames_.size(); }
  std::optional<Camera> KnownCamera() const override { return camera_; }
  const std::map<FrameIndex, Rigid3>& TrueCamFromWorld() const override { return cam_from_world_; }
  std::optional<cv::Mat> TrueDepth(FrameIndex) const override { return std::nullopt; }
  std::optional<cv::Mat> OccluderMask(FrameIndex) const override { return std::nullopt; }
  const std::string& Warning() const override { return warning_; }

 protected:
  explicit FrameClip(std::string name) : name_(std::move(name)) {}

  // The next frame, named by its number.
  Frame& Add(cv::Mat gray) {
    Frame& frame = frames_.emplace_back();
    frame.index = FrameIndex{static_cast<std::uint32_t>(frames_.size() - 1)};
    frame.name = std::to_string(frames_.size() - 1) + ".png";
    frame.gray = std::move(gray);
    return frame;
  }

  std::vector<Frame> frames_;
  std::optional<Camera> camera_;
  std::map<FrameIndex, Rigid3> cam_from_world_;

 private:
  std::string name_;
  std::string warning_;
  std::size_t next_ = 0;
};

}  // namespace cohort::test
