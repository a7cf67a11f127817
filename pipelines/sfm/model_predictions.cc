#include "pipelines/sfm/model_predictions.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "frontend/core/part_times.h"
#include "frontend/image/mask.h"

namespace cohort {
namespace {

// Tuned on the tuning clips.
constexpr double kBorderPx = 5.0;  // nothing is measured nearer to the image border
// In a frame, as many features are measured at most as the first pass observed in its fullest frame,
// times this. It bounds the time and the memory where the camera comes back to places it has seen,
// since every visit adds features: clips of a few seconds stay below it.
constexpr double kMostOverObserved = 2.0;

// Of a position in the picture.
bool IsBlack(const cv::Mat& mask, const Eigen::Vector2d& xy) {
  const cv::Point at(static_cast<int>(std::lround(xy.x())), static_cast<int>(std::lround(xy.y())));
  if (!cv::Rect({}, mask.size()).contains(at)) return true;
  return mask.at<std::uint8_t>(at) == 0;
}

bool IsBlackAround(const cv::Mat& mask, const Eigen::Vector2d& xy) {
  const double left = std::floor(xy.x());
  const double top = std::floor(xy.y());
  return IsBlack(mask, {left, top}) && IsBlack(mask, {left + 1.0, top}) &&
         IsBlack(mask, {left, top + 1.0}) && IsBlack(mask, {left + 1.0, top + 1.0});
}

bool HoldsFeature(const std::map<FrameIndex, std::set<FeatureId>>& by_frame,
                  FrameIndex frame,
                  FeatureId feature) {
  const auto found = by_frame.find(frame);
  return found != by_frame.end() && found->second.contains(feature);
}

}  // namespace

ModelPredictions::ModelPredictions(const TrackFile& file,
                                   const Reconstruction& model,
                                   int template_frames)
    : file_(file), model_(model), rows_(model) {
  std::map<FrameIndex, std::size_t> observed_in;
  for (const auto& [feature, point] : model.points) {
    std::vector<FrameIndex> seen;
    for (const Observation& observation : file.tracks.Track(feature)) {
      if (IsObserved(observation) && model.cam_from_world.contains(observation.frame)) {
        seen.push_back(observation.frame);
        ++observed_in[observation.frame];
      }
    }
    if (seen.empty()) continue;
    const auto middle = static_cast<std::ptrdiff_t>(seen.size() / 2);
    const auto half = static_cast<std::ptrdiff_t>(template_frames / 2);
    const auto count = static_cast<std::ptrdiff_t>(seen.size());
    const auto first = std::max<std::ptrdiff_t>(0, middle - half);
    const auto end = std::min(count, first + template_frames);
    for (auto i = first; i < end; ++i) template_features_[seen[i]].push_back(feature);
    features_[feature] = {.middle = seen[middle], .observations = seen.size()};
  }
  std::size_t most = 0;
  for (const auto& [frame, count] : observed_in) most = std::max(most, count);
  most_in_sight_ = static_cast<std::size_t>(kMostOverObserved * static_cast<double>(most));
}

void ModelPredictions::Mask(FrameIndex frame, const cv::Mat& mask) {
  if (mask.empty()) return;
  CheckMask(mask, {model_.camera.width_px, model_.camera.height_px});
  has_mask_ = true;
  for (const Observation* o : file_.tracks.InFrame(frame)) {
    if (IsObserved(*o) && IsBlack(mask, o->xy)) masked_[frame].insert(o->feature);
    if (IsBlackAround(mask, o->xy)) inside_mask_[frame].insert(o->feature);
  }
  if (!model_.cam_from_world.contains(frame)) return;
  for (const auto& [feature, seen] : features_) {
    const auto xy = InPicture(feature, frame);
    if (xy && IsBlack(mask, *xy)) hidden_[frame].insert(feature);
  }
}

std::vector<ModelPrediction> ModelPredictions::ForTemplates(FrameIndex frame) const {
  const TimedPart part("projection");
  std::vector<ModelPrediction> predictions;
  const auto it = template_features_.find(frame);
  if (it == template_features_.end()) return predictions;
  for (const FeatureId feature : it->second) {
    const auto xy = Project(model_.points.at(feature).in_world, frame);
    const auto warp = Warp(feature, features_.at(feature).middle, frame);
    if (xy && warp) predictions.push_back({feature, *xy, *warp});
  }
  return predictions;
}

std::vector<ModelPrediction> ModelPredictions::InSight(FrameIndex frame) const {
  const TimedPart part("projection");
  std::vector<ModelPrediction> predictions;
  if (!model_.cam_from_world.contains(frame)) return predictions;
  for (const auto& [feature, seen] : features_) {
    const auto xy = InPicture(feature, frame);
    if (!xy) continue;
    const auto warp = Warp(feature, seen.middle, frame);
    if (!warp || !IsMeasurable(*warp)) continue;
    const Observation* observation = file_.tracks.Find(feature, frame);
    predictions.push_back(
        {feature, *xy, *warp, observation != nullptr && IsObserved(*observation)});
  }
  KeepBest(predictions);
  return predictions;
}

// Those that the first pass observed here, and then those that it observed most often: few points
// with many observations hold the cameras together better than many points with few.
void ModelPredictions::KeepBest(std::vector<ModelPrediction>& predictions) const {
  if (predictions.size() <= most_in_sight_) return;
  const auto comes_first = [this](const ModelPrediction& a, const ModelPrediction& b) {
    if (a.observed_in_first_pass != b.observed_in_first_pass) return a.observed_in_first_pass;
    const std::size_t count_a = features_.at(a.feature).observations;
    const std::size_t count_b = features_.at(b.feature).observations;
    return count_a != count_b ? count_a > count_b : a.feature < b.feature;
  };
  std::ranges::nth_element(
      predictions, predictions.begin() + static_cast<std::ptrdiff_t>(most_in_sight_), comes_first);
  predictions.resize(most_in_sight_);
  std::ranges::sort(predictions, {}, &ModelPrediction::feature);
}

bool ModelPredictions::Knows(FeatureId feature, FrameIndex frame) const {
  return features_.contains(feature) && model_.cam_from_world.contains(frame);
}

std::optional<Eigen::Vector2d> ModelPredictions::InPicture(FeatureId feature,
                                                           FrameIndex frame) const {
  auto xy = Project(model_.points.at(feature).in_world, frame);
  if (!xy || !model_.camera.Contains(*xy, kBorderPx)) return std::nullopt;
  if (HoldsFeature(hidden_, frame, feature)) return std::nullopt;
  return xy;
}

bool ModelPredictions::IsInsideMask(const Observation& observation) const {
  return HoldsFeature(inside_mask_, observation.frame, observation.feature);
}

bool ModelPredictions::IsMasked(const Observation& observation) const {
  return HoldsFeature(masked_, observation.frame, observation.feature);
}

std::optional<Eigen::Vector2d> ModelPredictions::Project(const Eigen::Vector3d& in_world,
                                                         FrameIndex frame) const {
  return rows_.Project(CameraOf(model_, frame), frame, in_world);
}

std::optional<Eigen::Matrix2d> ModelPredictions::Warp(FeatureId feature,
                                                      FrameIndex from,
                                                      FrameIndex frame) const {
  return WarpOfFacingPatch(model_, rows_, model_.points.at(feature).in_world, from, frame);
}

bool IsMeasurable(const Eigen::Matrix2d& warp) {
  constexpr double kMaxScale = 2.0;  // tuned on the tuning clips
  const double scale = std::sqrt(warp.determinant());
  return scale <= kMaxScale && scale >= 1.0 / kMaxScale;
}

std::optional<Eigen::Matrix2d> WarpOfFacingPatch(const Reconstruction& model,
                                                 const RowPoses& rows,
                                                 const Eigen::Vector3d& in_world,
                                                 FrameIndex from,
                                                 FrameIndex to) {
  const Camera camera = CameraOf(model, from);
  const Camera camera_to = CameraOf(model, to);
  const auto xy = rows.Project(camera, from, in_world);
  if (!xy) return std::nullopt;
  const Rigid3 cam_from_world = rows.CamFromWorld(from, *xy);
  const Eigen::Vector3d x = cam_from_world * in_world;
  constexpr double kStepPx = 4.0;
  Eigen::Matrix2d warp;
  for (int axis = 0; axis < 2; ++axis) {
    std::array<Eigen::Vector2d, 2> ends;
    for (int side = 0; side < 2; ++side) {
      Eigen::Vector2d beside = *xy;
      beside[axis] += side == 0 ? -kStepPx : kStepPx;
      const Eigen::Vector3d on_patch = x.z() * camera.Unproject(beside).homogeneous();
      const auto end = rows.Project(camera_to, to, cam_from_world.Inverse() * on_patch);
      if (!end) return std::nullopt;
      ends[side] = *end;
    }
    warp.col(axis) = (ends[1] - ends[0]) / (2.0 * kStepPx);
  }
  if (!(warp.determinant() > 0.0)) return std::nullopt;
  return warp;
}

}  // namespace cohort
