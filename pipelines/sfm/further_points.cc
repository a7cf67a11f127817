#include "pipelines/sfm/further_points.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "backend/scene/reprojection.h"
#include "frontend/core/error.h"
#include "frontend/core/in_parallel.h"
#include "frontend/core/part_times.h"
#include "frontend/core/statistics.h"
#include "frontend/detect/corners.h"
#include "frontend/image/pyramid.h"
#include "pipelines/sfm/model_predictions.h"

namespace cohort {
namespace {

// The constants were tuned on rendered clips (a facade, a room) at several levels of darkness, and
// measured on others: docs/results/further_points.md.

// The narrow window is the more accurate one, as it includes less of other surfaces: by day, the
// median error of all points is 0.43 of the tracked points' with 15 px, 0.61 with 21, 1.5 with 31.
// In the dark the wide one yields five times as many points. It is used where the narrow one
// correlates with the next keyframe less than kSure.
constexpr int kNarrowPx = 15;
constexpr int kWidePx = 31;
constexpr double kSure = 0.9;
constexpr double kLeastCorrelation = 0.5;
constexpr double kMostAcrossPx = 1.0;  // from where a point can be
// As in the second pass.
constexpr PatchOptions kPatch = SecondPassMeasurementOptions{}.patch;

// Corners are looked for in every second keyframe, this far apart.
constexpr std::size_t kDetectEvery = 2;
constexpr double kMinDistancePx = 3.0;
// Of goodFeaturesToTrack, for texture that DetectCorners' window of 7 px does not resolve. Low, as
// it is a share of the strongest corner, which may be a lamp.
constexpr double kFineQuality = 0.001;
constexpr int kFineBlockPx = 3;
// At most this many corners a wanted point: in the dark most corners fail, which takes the time.
constexpr double kMostTries = 1.5;
// The share of corners that yield a point, before it is known, and how much it counts.
constexpr double kExpectedYield = 0.6;
constexpr double kExpectedCount = 100.0;

// A corner may be as near and as far as the points next to it, and somewhat beyond.
constexpr std::size_t kNeighbours = 10;
constexpr std::size_t kNearestNeighbours = 5;  // whose median depth is its first one
constexpr double kBeyondNeighbours = 1.5;
constexpr double kDepthSigmas = 3.0;
constexpr double kMostDepthSigma = 0.3;  // of a depth that counts as known

constexpr int kMostMisses = 1;          // in a row
constexpr std::size_t kDenseViews = 8;  // in successive keyframes; then thinner and thinner
constexpr std::size_t kLeastSightings = 5;
constexpr double kLeastAgreeing = 0.75;     // of the sightings
constexpr double kMostMahalanobis2 = 16.0;  // of a sighting that agrees: four standard deviations
constexpr double kQuantileOfTracked = 0.9;  // of the uncertainties of tracked points: the largest

double DistanceToSegment(const Eigen::Vector2d& x,
                         const Eigen::Vector2d& a,
                         const Eigen::Vector2d& b) {
  const Eigen::Vector2d way = b - a;
  const double length2 = way.squaredNorm();
  const double share = length2 > 0.0 ? std::clamp((x - a).dot(way) / length2, 0.0, 1.0) : 0.0;
  return (x - a - share * way).norm();
}

cv::Point PixelOf(const Eigen::Vector2d& xy, const cv::Mat& picture) {
  return {std::clamp(static_cast<int>(std::lround(xy.x())), 0, picture.cols - 1),
          std::clamp(static_cast<int>(std::lround(xy.y())), 0, picture.rows - 1)};
}

bool IsOpen(const cv::Mat& mask, const Eigen::Vector2d& xy) {
  return mask.empty() || mask.at<std::uint8_t>(PixelOf(xy, mask)) != 0;
}

// A point that a picture shows.
struct Known {
  Eigen::Vector2d xy;
  double inverse_depth;
};

// The inverse depths of the known points nearest to xy, the nearest first.
std::vector<double> InverseDepthsAround(const std::vector<Known>& known,
                                        const Eigen::Vector2d& xy) {
  std::vector<std::pair<double, double>> by_distance;
  by_distance.reserve(known.size());
  for (const Known& k : known) {
    by_distance.emplace_back((k.xy - xy).squaredNorm(), k.inverse_depth);
  }
  const std::size_t count = std::min(kNeighbours, by_distance.size());
  std::partial_sort(by_distance.begin(),
                    by_distance.begin() + static_cast<std::ptrdiff_t>(count),
                    by_distance.end());
  std::vector<double> inverse_depths;
  for (std::size_t i = 0; i < count; ++i) inverse_depths.push_back(by_distance[i].second);
  return inverse_depths;
}

}  // namespace

FurtherPoints::FurtherPoints(const TrackFile& file,
                             const Reconstruction& model,
                             std::span<const FrameIndex> keyframes,
                             std::size_t wanted)
    : file_(file),
      near_(model),
      model_(near_.get()),
      rows_(model_),
      keyframes_(keyframes.begin(), keyframes.end()),
      wanted_(wanted),
      seen_share_(keyframes_.size(), 0.0) {
  double count = 0.0;
  for (const auto& [feature, point] : model_.points) {
    if (point.views.empty()) continue;
    const auto first =
        std::lower_bound(keyframes_.begin(), keyframes_.end(), point.views.front().frame);
    const auto end =
        std::upper_bound(keyframes_.begin(), keyframes_.end(), point.views.back().frame);
    if (first >= end) continue;
    for (auto it = first; it != end; ++it) known_in_[*it].push_back(feature);
    seen_share_[static_cast<std::size_t>(first - keyframes_.begin())] += 1.0;
    count += 1.0;
  }
  double sum = 0.0;
  for (double& share : seen_share_) {
    sum += share;
    share = count > 0.0 ? sum / count : 0.0;
  }
}

std::optional<Eigen::Vector2d> FurtherPoints::Project(const Eigen::Vector3d& in_world,
                                                      FrameIndex frame) const {
  return rows_.Project(CameraOf(model_, frame), frame, in_world);
}

std::vector<WeightedRay> FurtherPoints::RaysOf(std::span<const Sighting> sightings) const {
  std::vector<WeightedRay> rays;
  rays.reserve(sightings.size());
  for (const Sighting& s : sightings) {
    const Camera camera = CameraOf(model_, s.frame);
    WeightedRay& ray = rays.emplace_back();
    ray.ray = {rows_.CamFromWorld(s.frame, s.xy), camera.Unproject(s.xy)};
    const Eigen::Matrix2d d_n = ProjectPixel(camera, ray.ray.n).d_n;
    ray.information = d_n.transpose() * s.shape.inverse() * d_n;
  }
  return rays;
}

bool FurtherPoints::IsDue(const Corner& corner) const {
  // Every keyframe at first, then every second, every fourth ...: depth needs a wide baseline,
  // which grows with the time, and each measurement costs the same.
  const std::size_t age = now_ - corner.first_keyframe;
  std::size_t step = 1;
  while (age >= kDenseViews * step) step *= 2;
  return age % step == 0;
}

double FurtherPoints::DistanceFromSegment(const Corner& corner,
                                          FrameIndex frame,
                                          const Eigen::Vector2d& xy) const {
  const Eigen::Vector3d x = corner.cam_from_world * corner.in_world;
  double nearest = corner.nearest;
  double farthest = corner.farthest;
  if (corner.depth_sigma > 0.0) {
    nearest = std::max(nearest, x.z() - kDepthSigmas * corner.depth_sigma);
    farthest = std::min(farthest, x.z() + kDepthSigmas * corner.depth_sigma);
  }
  const Rigid3 world_from_cam = corner.cam_from_world.Inverse();
  const Eigen::Vector3d ray = x / x.z();
  const auto a = Project(world_from_cam * (nearest * ray).eval(), frame);
  const auto b = Project(world_from_cam * (farthest * ray).eval(), frame);
  return a && b ? DistanceToSegment(xy, *a, *b) : model_.camera.width_px;
}

std::optional<FurtherPoints::Measured> FurtherPoints::Measure(const Corner& corner,
                                                              const Pyramid& smooth,
                                                              FrameIndex frame,
                                                              const Eigen::Vector3d& in_world,
                                                              int window_px) const {
  const auto xy = Project(in_world, frame);
  if (!xy || !model_.camera.Contains(*xy, 0.5 * window_px)) return std::nullopt;
  const auto warp =
      WarpOfFacingPatch(model_, rows_, in_world, corner.sightings.front().frame, frame);
  if (!warp || !IsMeasurable(*warp)) return std::nullopt;
  AnchorPatch anchor = corner.anchor;
  anchor.warp = corner.beyond_prediction * *warp;
  Measured measured;
  measured.m = MeasurePatch(smooth, anchor, *xy, window_px, kBlurredNoiseFactor);
  if (!measured.m.converged || measured.m.correlation < kLeastCorrelation ||
      DistanceFromSegment(corner, frame, measured.m.xy) > kMostAcrossPx) {
    return std::nullopt;
  }
  measured.window_px = window_px;
  measured.beyond_prediction = measured.m.warp * warp->inverse();
  return measured;
}

std::optional<FurtherPoints::Measured> FurtherPoints::MeasureFirst(const Corner& corner,
                                                                   const Pyramid& smooth,
                                                                   FrameIndex frame) const {
  const Eigen::Vector3d x = corner.cam_from_world * corner.in_world;
  const auto at_share = [&](double share) -> Eigen::Vector3d {
    const double depth = 1.0 / std::lerp(1.0 / corner.farthest, 1.0 / corner.nearest, share);
    return corner.cam_from_world.Inverse() * (depth / x.z() * x).eval();
  };
  const std::array starts{corner.in_world, at_share(0.25), at_share(0.75)};
  for (const int window_px : {kNarrowPx, kWidePx}) {
    for (const Eigen::Vector3d& start : starts) {
      auto measured = Measure(corner, smooth, frame, start, window_px);
      if (!measured) continue;
      if (window_px == kWidePx || measured->m.correlation >= kSure) return measured;
      break;
    }
  }
  return std::nullopt;
}

void FurtherPoints::Take(Corner& corner,
                         const Measured& measured,
                         FrameIndex frame,
                         const cv::Mat& bgr) const {
  const Measurement& m = measured.m;
  if (corner.window_px == 0) NarrowAnchor(measured.window_px, corner.anchor);
  corner.window_px = measured.window_px;
  corner.beyond_prediction = measured.beyond_prediction;
  corner.anchor.warp_covariance = m.warp_covariance;
  corner.sightings.push_back({frame, m.xy, m.shape, bgr.at<cv::Vec3b>(PixelOf(m.xy, bgr))});
  // The first sighting has the noise of its patch, about as much as the others have.
  Sighting& first = corner.sightings.front();
  first.shape += (m.shape - first.shape) / static_cast<double>(corner.sightings.size() - 1);
  const auto point = TriangulateWeighted(RaysOf(corner.sightings), corner.in_world);
  if (!point) return;
  const double depth = (corner.cam_from_world * point->in_world).z();
  const Eigen::Vector3d axis =
      corner.cam_from_world.rotation.conjugate() * Eigen::Vector3d::UnitZ();
  const double sigma = std::sqrt(axis.dot(point->covariance * axis));
  if (depth < corner.nearest || depth > corner.farthest || !(sigma < kMostDepthSigma * depth)) {
    return;
  }
  corner.in_world = point->in_world;
  corner.depth_sigma = sigma;
}

void FurtherPoints::MeasureCorners(const Pyramid& smooth, const Frame& frame, const cv::Mat& bgr) {
  ForEachInParallel(corners_.size(), [&](std::size_t i) {
    Corner& corner = corners_[i];
    if (!IsDue(corner)) return;
    corner.anchor.warp_covariance.diagonal().array() += kPatch.warp_noise * kPatch.warp_noise;
    const auto measured =
        corner.window_px == 0
            ? MeasureFirst(corner, smooth, frame.index)
            : Measure(corner, smooth, frame.index, corner.in_world, corner.window_px);
    if (measured && IsOpen(frame.mask, measured->m.xy)) {
      Take(corner, *measured, frame.index, bgr);
      corner.misses = 0;
    } else {
      ++corner.misses;
    }
  });
}

void FurtherPoints::EndCorners(int most_misses) {
  const auto has_ended = [&](const Corner& corner) { return corner.misses > most_misses; };
  for (Corner& corner : corners_) {
    if (!has_ended(corner) || corner.sightings.size() < kLeastSightings) continue;
    candidates_.push_back({std::move(corner.sightings), corner.in_world});
  }
  std::erase_if(corners_, has_ended);
}

int FurtherPoints::CornersWanted() const {
  // The points are spread as those of the tracks: the part of the scene that the camera has seen.
  const double target = static_cast<double>(wanted_) * seen_share_[now_];
  const auto done = static_cast<double>(candidates_.size());
  const auto live = static_cast<double>(corners_.size());
  const auto tried = static_cast<double>(detected_);
  const double yield = (done + kExpectedYield * kExpectedCount) / (tried - live + kExpectedCount);
  return static_cast<int>(
      std::min((target - done - yield * live) / yield, kMostTries * target - tried));
}

std::vector<Eigen::Vector2d> FurtherPoints::NewCorners(const Pyramid& raw,
                                                       const Pyramid& smooth,
                                                       const cv::Mat& mask,
                                                       std::vector<Eigen::Vector2d> occupied,
                                                       int wanted) const {
  constexpr int kBorderPx = kNarrowPx / 2 + 1;
  const DetectorOptions options{.max_features = wanted + static_cast<int>(occupied.size()),
                                .min_distance_px = kMinDistancePx};
  std::vector<Eigen::Vector2d> corners =
      DetectCorners(raw.levels[0], occupied, mask, kBorderPx, wanted, options);
  const int left = wanted - static_cast<int>(corners.size());
  const cv::Rect inside(
      kBorderPx, kBorderPx, raw.width() - 2 * kBorderPx, raw.height() - 2 * kBorderPx);
  if (left <= 0 || inside.width <= 0 || inside.height <= 0) return corners;
  cv::Mat free(raw.levels[0].size(), CV_8UC1, cv::Scalar(0));
  free(inside).setTo(255);
  if (!mask.empty()) free.setTo(0, mask == 0);
  occupied.insert(occupied.end(), corners.begin(), corners.end());
  for (const Eigen::Vector2d& xy : occupied) {
    cv::circle(free, PixelOf(xy, free), static_cast<int>(kMinDistancePx), 0, cv::FILLED);
  }
  std::vector<cv::Point2f> fine;
  cv::goodFeaturesToTrack(
      smooth.levels[0], fine, left, kFineQuality, kMinDistancePx, free, kFineBlockPx);
  for (const cv::Point2f& xy : fine) corners.emplace_back(xy.x, xy.y);
  return corners;
}

void FurtherPoints::Detect(const Pyramid& raw,
                           const Pyramid& smooth,
                           const Frame& frame,
                           const cv::Mat& bgr) {
  const int wanted = CornersWanted();
  if (wanted <= 0 || now_ + kLeastSightings > keyframes_.size()) return;
  std::vector<Eigen::Vector2d> occupied;
  const auto occupy = [&](const Eigen::Vector3d& in_world) {
    const auto xy = Project(in_world, frame.index);
    if (!xy || !model_.camera.Contains(*xy)) return false;
    occupied.push_back(*xy);
    return true;
  };
  std::vector<Known> known;
  for (const FeatureId feature : known_in_[frame.index]) {
    const Eigen::Vector3d& in_world = model_.points.at(feature).in_world;
    if (!occupy(in_world)) continue;
    const double depth = (rows_.CamFromWorld(frame.index, occupied.back()) * in_world).z();
    if (depth > 0.0) known.push_back({occupied.back(), 1.0 / depth});
  }
  if (known.empty()) return;
  for (const Corner& corner : corners_) occupy(corner.in_world);
  for (const Candidate& candidate : candidates_) occupy(candidate.in_world);

  const std::vector<Eigen::Vector2d> found =
      NewCorners(raw, smooth, frame.mask, std::move(occupied), wanted);
  detected_ += found.size();
  const std::size_t first = corners_.size();
  corners_.resize(first + found.size());
  const Camera camera = CameraOf(model_, frame.index);
  ForEachInParallel(found.size(), [&](std::size_t i) {
    const Eigen::Vector2d& xy = found[i];
    std::vector<double> inverse_depths = InverseDepthsAround(known, xy);
    const auto [least, most] = std::ranges::minmax(inverse_depths);
    Corner& corner = corners_[first + i];
    corner.nearest = 1.0 / (kBeyondNeighbours * most);
    corner.farthest = kBeyondNeighbours / least;
    inverse_depths.resize(std::min(kNearestNeighbours, inverse_depths.size()));
    const double depth = 1.0 / Median(std::move(inverse_depths));
    corner.sightings.push_back(
        {frame.index, xy, Eigen::Matrix2d::Zero(), bgr.at<cv::Vec3b>(PixelOf(xy, bgr))});
    corner.anchor = CopyAnchor(smooth, xy, kWidePx, Eigen::Matrix2d::Identity());
    corner.cam_from_world = rows_.CamFromWorld(frame.index, xy);
    corner.in_world =
        corner.cam_from_world.Inverse() * (depth * camera.Unproject(xy).homogeneous()).eval();
    corner.first_keyframe = now_;
  });
}

void FurtherPoints::Follow(Frame frame, const cv::Mat& bgr) {
  const TimedPart part("further points");
  Check(now_ < keyframes_.size() && keyframes_[now_] == frame.index, "keyframes come in order");
  const LightChange light = exposure_.Follow(frame.gray);
  frame = WithoutLight(std::move(frame), light);
  const Pyramid raw = BuildPyramid(frame, 2);
  const Pyramid smooth = SmoothPyramid(raw, kPatch.denoise_sigma_px);
  MeasureCorners(smooth, frame, bgr);
  EndCorners(kMostMisses);
  if (now_ % kDetectEvery == 0) Detect(raw, smooth, frame, bgr);
  ++now_;
}

FurtherPoints::Estimate FurtherPoints::EstimateFrom(const Candidate& candidate) const {
  Estimate estimate;
  const std::vector<WeightedRay> rays = RaysOf(candidate.sightings);
  constexpr double kUnknowns = 3.0;
  const double measured = 2.0 * static_cast<double>(rays.size());
  if (measured <= kUnknowns) return estimate;
  estimate.point = TriangulateWeighted(rays, candidate.in_world);
  if (!estimate.point) return estimate;
  const Eigen::Vector3d& in_world = estimate.point->in_world;
  for (const auto& [ray, information] : rays) {
    const Eigen::Vector2d r = (ray.cam_from_world * in_world).hnormalized() - ray.n;
    estimate.mahalanobis2.push_back(r.dot(information * r) * measured / (measured - kUnknowns));
  }
  estimate.uncertainty = std::sqrt(estimate.point->covariance.trace()) /
                         (rays.front().ray.cam_from_world * in_world).norm();
  return estimate;
}

std::vector<FurtherPoints::Estimate> FurtherPoints::EstimateAll(
    std::span<const Candidate> candidates) const {
  std::vector<Estimate> estimates(candidates.size());
  ForEachInParallel(candidates.size(),
                    [&](std::size_t i) { estimates[i] = EstimateFrom(candidates[i]); });
  return estimates;
}

namespace {

// The factor of the shapes, from how far the sightings lie from their points.
template <typename Estimates>
double FactorOfShapes(const Estimates& estimates) {
  std::vector<double> mahalanobis2;
  for (const auto& estimate : estimates) {
    mahalanobis2.insert(
        mahalanobis2.end(), estimate.mahalanobis2.begin(), estimate.mahalanobis2.end());
  }
  return Median(std::move(mahalanobis2)) / kMedianChiSquare2;
}

}  // namespace

double FurtherPoints::UncertaintyOfTrackedPoints() const {
  std::vector<Candidate> tracked;
  for (const auto& [feature, point] : model_.points) {
    Candidate& candidate = tracked.emplace_back();
    candidate.in_world = point.in_world;
    for (const PointView& view : point.views) {
      const Observation* o = file_.tracks.Find(feature, view.frame);
      Sighting& sighting = candidate.sightings.emplace_back();
      sighting.frame = view.frame;
      sighting.xy = view.xy;
      if (o != nullptr && o->covariance) sighting.shape = o->covariance->Matrix();
    }
  }
  const std::vector<Estimate> estimates = EstimateAll(tracked);
  std::vector<double> uncertainties;
  for (const Estimate& estimate : estimates) {
    if (estimate.point) uncertainties.push_back(estimate.uncertainty);
  }
  return std::sqrt(FactorOfShapes(estimates)) *
         Quantile(std::move(uncertainties), kQuantileOfTracked);
}

std::map<FeatureId, FurtherPoint> FurtherPoints::Finish() {
  const TimedPart part("further points");
  EndCorners(-1);
  std::vector<Estimate> estimates = EstimateAll(candidates_);
  const double factor = FactorOfShapes(estimates);
  const double most_uncertainty = UncertaintyOfTrackedPoints();

  struct Accepted {
    double uncertainty;
    std::size_t candidate;
  };
  std::vector<Accepted> accepted;
  for (std::size_t i = 0; i < candidates_.size(); ++i) {
    Candidate& candidate = candidates_[i];
    Estimate& estimate = estimates[i];
    if (!estimate.point) continue;
    std::vector<Sighting> agreeing;
    for (std::size_t s = 0; s < candidate.sightings.size(); ++s) {
      if (estimate.mahalanobis2[s] > kMostMahalanobis2 * factor) continue;
      agreeing.push_back(candidate.sightings[s]);
    }
    if (agreeing.size() < kLeastSightings ||
        static_cast<double>(agreeing.size()) <
            kLeastAgreeing * static_cast<double>(candidate.sightings.size())) {
      continue;
    }
    if (agreeing.size() < candidate.sightings.size()) {
      candidate = {std::move(agreeing), estimate.point->in_world};
      estimate = EstimateFrom(candidate);
    }
    const double uncertainty = std::sqrt(factor) * estimate.uncertainty;
    if (estimate.point && uncertainty <= most_uncertainty) accepted.push_back({uncertainty, i});
  }
  if (accepted.size() > wanted_) {
    std::ranges::stable_sort(accepted, {}, &Accepted::uncertainty);
    accepted.resize(wanted_);
    std::ranges::sort(accepted, {}, &Accepted::candidate);
  }

  std::uint32_t id = 0;
  for (const FeatureId feature : file_.tracks.features()) id = std::max(id, ToInt(feature) + 1);
  std::map<FeatureId, FurtherPoint> points;
  Reconstruction made;  // to bring the points into the world of the model
  for (const auto& [uncertainty, i] : accepted) {
    const FeatureId feature{id++};
    FurtherPoint& further = points[feature];
    further.uncertainty = uncertainty;
    made.points[feature].in_world = estimates[i].point->in_world;
    for (const Sighting& s : candidates_[i].sightings) {
      further.point.views.push_back({s.frame, s.xy});
      further.bgr += Eigen::Vector3d(s.bgr[0], s.bgr[1], s.bgr[2]);
    }
    further.bgr /= static_cast<double>(candidates_[i].sightings.size());
  }
  made = near_.InWorldOfModel(std::move(made));
  for (auto& [feature, further] : points) {
    further.point.in_world = made.points.at(feature).in_world;
  }
  return points;
}

}  // namespace cohort
