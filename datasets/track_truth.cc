#include "datasets/track_truth.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <utility>

namespace cohort {
namespace {

bool IsCovered(const Sequence& sequence,
               std::map<FrameIndex, std::optional<cv::Mat>>& masks,
               FrameIndex frame,
               const Eigen::Vector2d& xy) {
  auto it = masks.find(frame);
  if (it == masks.end()) {
    it = masks.emplace(frame, sequence.OccluderMask(frame)).first;
  }
  if (!it->second) return false;
  const cv::Mat& mask = *it->second;
  const int x = std::clamp(static_cast<int>(std::lround(xy.x())), 0, mask.cols - 1);
  const int y = std::clamp(static_cast<int>(std::lround(xy.y())), 0, mask.rows - 1);
  return mask.at<std::uint8_t>(y, x) != 0;
}

// Eight directions, at the radius and at half of it.
template <typename Function>
bool AnyAround(const Eigen::Vector2d& xy, double radius_px, const Function& differs) {
  for (const double radius : {0.5 * radius_px, radius_px}) {
    for (int i = 0; i < 8; ++i) {
      const double angle = i * std::numbers::pi / 4.0;
      if (differs(
              Eigen::Vector2d(xy + radius * Eigen::Vector2d(std::cos(angle), std::sin(angle))))) {
        return true;
      }
    }
  }
  return false;
}

class SceneTruth final : public TrackTruth {
 public:
  SceneTruth(const Sequence& sequence, const SyntheticSceneOptions& options)
      : sequence_(sequence), scene_(options) {}

  std::optional<Anchor> Pick(FrameIndex frame, const Eigen::Vector2d& xy) override {
    const auto& moment = MomentAt(frame);
    const auto point = moment.Pick(xy);
    if (!point) return std::nullopt;
    return Anchor{frame, moment.WorldPoint(*point), *point};
  }

  std::optional<TruePosition> Locate(const Anchor& anchor, FrameIndex frame) override {
    const auto& moment = MomentAt(frame);
    const auto xy = moment.Project(anchor.on_surface);
    if (!xy) return std::nullopt;
    TruePosition position;
    position.xy = *xy;
    position.in_image = scene_.camera().Contains(*xy);
    position.visible = position.in_image && !IsCovered(sequence_, masks_, frame, *xy) &&
                       moment.IsUnobstructed(anchor.on_surface);
    return position;
  }

  bool IsOnDepthEdge(FrameIndex frame, const Eigen::Vector2d& xy, double radius_px) override {
    const auto& moment = MomentAt(frame);
    const auto depth_at = [&](const Eigen::Vector2d& at) {
      const auto point = moment.Pick(at);
      return point ? moment.Depth(*point) : 0.0;
    };
    const double depth = depth_at(xy);
    return AnyAround(xy, radius_px, [&](const Eigen::Vector2d& at) {
      return std::abs(depth_at(at) - depth) > 0.03 * depth;
    });
  }

 private:
  const SyntheticScene::Moment& MomentAt(FrameIndex frame) {
    const auto it = moments_.find(frame);
    if (it != moments_.end()) return it->second;
    return moments_.emplace(frame, scene_.At(static_cast<int>(ToInt(frame)))).first->second;
  }

  const Sequence& sequence_;
  SyntheticScene scene_;
  std::map<FrameIndex, SyntheticScene::Moment> moments_;
  std::map<FrameIndex, std::optional<cv::Mat>> masks_;
};

class DepthTruth final : public TrackTruth {
 public:
  DepthTruth(const Sequence& sequence, Camera camera) : sequence_(sequence), camera_(camera) {}

  std::optional<Anchor> Pick(FrameIndex frame, const Eigen::Vector2d& xy) override {
    const auto pose = sequence_.TrueCamFromWorld().find(frame);
    const auto depth = DepthAt(frame, xy);
    if (pose == sequence_.TrueCamFromWorld().end() || !depth) return std::nullopt;
    return Anchor{frame,
                  pose->second.Inverse() * (*depth * camera_.Unproject(xy).homogeneous()),
                  SurfacePoint{}};
  }

  std::optional<TruePosition> Locate(const Anchor& anchor, FrameIndex frame) override {
    const auto pose = sequence_.TrueCamFromWorld().find(frame);
    if (pose == sequence_.TrueCamFromWorld().end()) return std::nullopt;
    const Eigen::Vector3d x_in_cam = pose->second * anchor.in_world;
    const auto xy = camera_.Project(x_in_cam);
    if (!xy) return std::nullopt;
    TruePosition position;
    position.xy = *xy;
    position.in_image = camera_.Contains(*xy);
    if (position.in_image && !IsCovered(sequence_, masks_, frame, *xy)) {
      const auto depth = DepthAt(frame, *xy);
      position.visible = depth && *depth > 0.98 * x_in_cam.z() - 0.01;
    }
    return position;
  }

  bool IsOnDepthEdge(FrameIndex frame, const Eigen::Vector2d& xy, double radius_px) override {
    const auto depth = DepthAt(frame, xy);
    if (!depth) return true;
    return AnyAround(xy, radius_px, [&](const Eigen::Vector2d& at) {
      const auto there = DepthAt(frame, at);
      return !there || std::abs(*there - *depth) > 0.03 * *depth;
    });
  }

 private:
  // Linear in inverse depth, which is exact on a plane.
  std::optional<double> DepthAt(FrameIndex frame, const Eigen::Vector2d& xy) {
    auto it = depths_.find(frame);
    if (it == depths_.end()) {
      // A track asks frame after frame: all of a clip are kept, 1.2 MB each at 640 x 480.
      it = depths_.emplace(frame, sequence_.TrueDepth(frame)).first;
    }
    if (!it->second) return std::nullopt;
    const cv::Mat& depth = *it->second;
    const int x = static_cast<int>(std::floor(xy.x()));
    const int y = static_cast<int>(std::floor(xy.y()));
    if (x < 0 || y < 0 || x + 1 >= depth.cols || y + 1 >= depth.rows) return std::nullopt;
    const std::array<float, 4> z{depth.at<float>(y, x),
                                 depth.at<float>(y, x + 1),
                                 depth.at<float>(y + 1, x),
                                 depth.at<float>(y + 1, x + 1)};
    const auto [least, most] = std::minmax_element(z.begin(), z.end());
    if (!(*least > 0.0F) || *most > 1.02F * *least) return std::nullopt;
    const double a = xy.x() - x;
    const double b = xy.y() - y;
    const double inverse = (1 - b) * ((1 - a) / z[0] + a / z[1]) + b * ((1 - a) / z[2] + a / z[3]);
    return 1.0 / inverse;
  }

  const Sequence& sequence_;
  Camera camera_;
  std::map<FrameIndex, std::optional<cv::Mat>> depths_;
  std::map<FrameIndex, std::optional<cv::Mat>> masks_;
};

}  // namespace

std::unique_ptr<TrackTruth> OpenTrackTruth(const Sequence& sequence,
                                           const std::filesystem::path& input) {
  if (std::filesystem::is_directory(input)) {
    if (const auto scene = ReadSceneFile(input)) {
      return std::make_unique<SceneTruth>(sequence, *scene);
    }
  }
  const auto camera = sequence.KnownCamera();
  const auto& poses = sequence.TrueCamFromWorld();
  if (!camera || poses.empty() || !sequence.TrueDepth(poses.begin()->first)) return nullptr;
  return std::make_unique<DepthTruth>(sequence, *camera);
}

}  // namespace cohort
