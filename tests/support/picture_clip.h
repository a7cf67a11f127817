#pragma once

#include <map>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "datasets/readers/sequence.h"

namespace cohort::test {

// Pictures as a clip that is never on disk.
class PictureClip : public Sequence {
 public:
  explicit PictureClip(const Pictures& pictures, std::optional<Camera> camera = std::nullopt)
      : camera_(std::move(camera)) {
    for (const cv::Mat& picture : pictures) {
      Frame& frame = frames_.emplace_back();
      frame.index = FrameIndex{static_cast<std::uint32_t>(frames_.size() - 1)};
      frame.name = std::to_string(frames_.size() - 1) + ".png";
      frame.gray = picture;
    }
  }

  std::optional<Frame> Next() override {
    if (next_ == frames_.size()) return std::nullopt;
    return frames_[next_++];
  }
  void Rewind() override { next_ = 0; }
  std::string Name() const override { return "hard"; }
  std::filesystem::path ImageRoot() const override { return {}; }
  std::optional<std::size_t> FrameCount() const override { return frames_.size(); }
  std::optional<Camera> KnownCamera() const override { return camera_; }
  const std::map<FrameIndex, Rigid3>& TrueCamFromWorld() const override { return poses_; }
  std::optional<cv::Mat> TrueDepth(FrameIndex) const override { return std::nullopt; }
  std::optional<cv::Mat> OccluderMask(FrameIndex) const override { return std::nullopt; }
  const std::string& Warning() const override { return warning_; }

 private:
  std::vector<Frame> frames_;
  std::optional<Camera> camera_;
  std::map<FrameIndex, Rigid3> poses_;
  std::string warning_;
  std::size_t next_ = 0;
};

}  // namespace cohort::test
