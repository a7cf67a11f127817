#include "datasets/truth/track_truth.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "datasets/render/synthetic_scene.h"
#include "frontend/core/error.h"
#include "frontend/image/read_image.h"

namespace cohort {
namespace {

// Caches the data of a frame for the next track in it. It is emptied when it holds many frames: the
// tracks of a long clip come in the order of their births.
template <typename T>
class FrameCache {
 public:
  template <typename Make>
  const T& Get(FrameIndex frame, const Make& make) {
    auto it = entries_.find(frame);
    if (it == entries_.end()) {
      constexpr std::size_t kMostFrames = 600;
      if (entries_.size() >= kMostFrames) entries_.clear();
      it = entries_.emplace(frame, make()).first;
    }
    return it->second;
  }

 private:
  std::map<FrameIndex, T> entries_;
};

class OccluderMasks {
 public:
  explicit OccluderMasks(const Sequence& sequence) : sequence_(sequence) {}

  bool Cover(FrameIndex frame, const Eigen::Vector2d& xy) {
    const std::optional<cv::Mat>& mask =
        masks_.Get(frame, [&] { return sequence_.OccluderMask(frame); });
    if (!mask) return false;
    const int x = std::clamp(static_cast<int>(std::lround(xy.x())), 0, mask->cols - 1);
    const int y = std::clamp(static_cast<int>(std::lround(xy.y())), 0, mask->rows - 1);
    return mask->at<std::uint8_t>(y, x) != 0;
  }

 private:
  const Sequence& sequence_;
  FrameCache<std::optional<cv::Mat>> masks_;
};

// Inverse depth is linear on a plane of any slope, so a jump appears as a second difference of more
// than the share `jump` of it. 0 is unknown.
template <typename InverseDepthAt>
bool JumpsAround(const Eigen::Vector2d& xy,
                 double radius_px,
                 double jump,
                 const InverseDepthAt& inverse_depth_at) {
  const int radius = std::max(1, static_cast<int>(std::ceil(radius_px)));
  const int side = 2 * radius + 1;
  std::vector<double> near(side * side);
  const auto at = [&](int dx, int dy) -> double& {
    return near[(dy + radius) * side + dx + radius];
  };
  for (int dy = -radius; dy <= radius; ++dy) {
    for (int dx = -radius; dx <= radius; ++dx) {
      at(dx, dy) = inverse_depth_at(std::lround(xy.x()) + dx, std::lround(xy.y()) + dy);
      if (at(dx, dy) == 0.0) return true;
    }
  }
  const auto bends = [&](double a, double b, double c) {
    return std::abs(a - 2.0 * b + c) > jump * b;
  };
  for (int i = -radius; i <= radius; ++i) {
    for (int k = 1 - radius; k < radius; ++k) {
      if (bends(at(k - 1, i), at(k, i), at(k + 1, i))) return true;
      if (bends(at(i, k - 1), at(i, k), at(i, k + 1))) return true;
    }
  }
  return false;
}

class SceneTruth final : public TrackTruth {
 public:
  SceneTruth(const Sequence& sequence, const SceneFile& file)
      : file_(file), scene_(file.options), masks_(sequence) {}

  std::optional<Anchor> Pick(FrameIndex frame, const Eigen::Vector2d& xy) override {
    if (masks_.Cover(frame, xy)) return std::nullopt;
    const SceneMoment& moment = MomentAt(frame);
    const auto point = moment.Pick(xy);
    if (!point) return std::nullopt;
    return Anchor{frame, moment.PointInWorld(*point), *point};
  }

  std::optional<TruePosition> Locate(const Anchor& anchor, FrameIndex frame) override {
    const SceneMoment& moment = MomentAt(frame);
    const auto sight = moment.Locate(anchor.on_surface);
    if (!sight) return std::nullopt;
    TruePosition position{sight->xy, scene_.camera().Contains(sight->xy), false};
    position.visible = position.in_image && !masks_.Cover(frame, sight->xy) &&
                       moment.InverseDepth(sight->xy) * sight->depth < 1.001;
    return position;
  }

  bool IsOnDepthEdge(FrameIndex frame, const Eigen::Vector2d& xy, double radius_px) override {
    const SceneMoment& moment = MomentAt(frame);
    // A pixel without any surface counts as infinitely far.
    return JumpsAround(xy, radius_px, 0.02, [&](long x, long y) {
      return std::max(1e-9, moment.InverseDepth(Eigen::Vector2d(x, y)));
    });
  }

 private:
  const SceneMoment& MomentAt(FrameIndex frame) {
    return moments_.Get(frame, [&] { return SceneMoment(scene_, file_.FrameOf(frame)); });
  }

  SceneFile file_;
  SyntheticScene scene_;
  FrameCache<SceneMoment> moments_;
  OccluderMasks masks_;
};

class DepthTruth final : public TrackTruth {
 public:
  DepthTruth(const Sequence& sequence, const Camera& camera)
      : sequence_(sequence), camera_(camera), masks_(sequence) {}

  std::optional<Anchor> Pick(FrameIndex frame, const Eigen::Vector2d& xy) override {
    const auto pose = sequence_.TrueCamFromWorld().find(frame);
    if (pose == sequence_.TrueCamFromWorld().end() || masks_.Cover(frame, xy)) return std::nullopt;
    const auto depth_m = DepthAt(frame, xy);
    if (!depth_m) return std::nullopt;
    const Eigen::Vector3d x_in_cam = *depth_m * camera_.Unproject(xy).homogeneous();
    return Anchor{frame, pose->second.Inverse() * x_in_cam, SurfacePoint{}};
  }

  std::optional<TruePosition> Locate(const Anchor& anchor, FrameIndex frame) override {
    const auto pose = sequence_.TrueCamFromWorld().find(frame);
    if (pose == sequence_.TrueCamFromWorld().end()) return std::nullopt;
    const Eigen::Vector3d x_in_cam = pose->second * anchor.x_in_world;
    const auto xy = camera_.Project(x_in_cam);
    if (!xy) return std::nullopt;
    TruePosition position{*xy, camera_.Contains(*xy), false};
    if (position.in_image && !masks_.Cover(frame, *xy)) {
      const auto depth_m = DepthAt(frame, *xy);
      position.visible = depth_m && std::abs(*depth_m - x_in_cam.z()) < 0.03 * x_in_cam.z() + 0.02;
    }
    return position;
  }

  bool IsOnDepthEdge(FrameIndex frame, const Eigen::Vector2d& xy, double radius_px) override {
    const cv::Mat& units = UnitsAt(frame);
    if (units.empty()) return true;
    return JumpsAround(xy, radius_px, 0.05, [&](long x, long y) {
      const auto column = static_cast<int>(std::clamp(x, 0L, units.cols - 1L));
      const auto row = static_cast<int>(std::clamp(y, 0L, units.rows - 1L));
      const int z = units.at<std::uint16_t>(row, column);
      return z == 0 ? 0.0 : 1.0 / z;
    });
  }

 private:
  // As in TUM's files, so that 16 bits lose nothing.
  static constexpr double kUnitsPerMetre = 5000.0;

  const cv::Mat& UnitsAt(FrameIndex frame) {
    return depths_.Get(frame, [&] {
      cv::Mat units;
      if (const auto depth_m = sequence_.TrueDepth(frame)) {
        depth_m->convertTo(units, CV_16U, kUnitsPerMetre);
      }
      return units;
    });
  }

  std::optional<double> DepthAt(FrameIndex frame, const Eigen::Vector2d& xy) {
    const cv::Mat& units = UnitsAt(frame);
    if (units.empty() || !camera_.Contains(xy)) return std::nullopt;
    // A picture may be one pixel wide.
    const int x = std::max(0, std::min(static_cast<int>(xy.x()), units.cols - 2));
    const int y = std::max(0, std::min(static_cast<int>(xy.y()), units.rows - 2));
    const int right = std::min(x + 1, units.cols - 1);
    const int below = std::min(y + 1, units.rows - 1);
    const std::array<double, 4> z{static_cast<double>(units.at<std::uint16_t>(y, x)),
                                  static_cast<double>(units.at<std::uint16_t>(y, right)),
                                  static_cast<double>(units.at<std::uint16_t>(below, x)),
                                  static_cast<double>(units.at<std::uint16_t>(below, right))};
    const auto [least, most] = std::minmax_element(z.begin(), z.end());
    if (!(*least > 0.0) || *most > 1.02 * *least) return std::nullopt;
    const double a = xy.x() - x;
    const double b = xy.y() - y;
    const double inverse = (1 - b) * ((1 - a) / z[0] + a / z[1]) + b * ((1 - a) / z[2] + a / z[3]);
    return 1.0 / (inverse * kUnitsPerMetre);
  }

  const Sequence& sequence_;
  Camera camera_;
  FrameCache<cv::Mat> depths_;
  OccluderMasks masks_;
};

// Empty if they do not come from files.
cv::Size SizeOfPictures(const Sequence& sequence) {
  if (const auto camera = sequence.KnownCamera()) return {camera->width_px, camera->height_px};
  const std::vector<std::filesystem::path> files = sequence.Files();
  return files.empty() ? cv::Size() : ReadImage(files.back()).size();
}

// A scene.json that was copied beside other pictures would give wrong positions.
void CheckSize(const SceneFile& scene,
               const Sequence& sequence,
               const std::filesystem::path& folder) {
  const cv::Size size = SizeOfPictures(sequence);
  const SyntheticSceneOptions& made = scene.options;
  if (size.empty() || size == cv::Size(made.width_px, made.height_px)) return;
  ThrowError(
      "{} describes a scene of {}x{}, but the pictures of {} are {}x{}: it belongs to another clip",
      (folder / "scene.json").string(),
      made.width_px,
      made.height_px,
      sequence.Name(),
      size.width,
      size.height);
}

}  // namespace

std::unique_ptr<TrackTruth> OpenTrackTruth(const Sequence& sequence,
                                           const std::filesystem::path& input) {
  if (std::filesystem::is_directory(input)) {
    if (const auto scene = ReadSceneFile(input)) {
      CheckSize(*scene, sequence, input);
      return std::make_unique<SceneTruth>(sequence, *scene);
    }
  }
  const auto camera = sequence.KnownCamera();
  const auto& poses = sequence.TrueCamFromWorld();
  const auto has_depth = [&](const auto& pose) {
    return sequence.TrueDepth(pose.first).has_value();
  };
  if (!camera || std::ranges::none_of(poses, has_depth)) return nullptr;
  return std::make_unique<DepthTruth>(sequence, *camera);
}

}  // namespace cohort
