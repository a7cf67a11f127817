#include "backend/adjust/working_model.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "backend/adjust/absolute_pose.h"
#include "backend/geometry/triangulation.h"
#include "frontend/core/statistics.h"

namespace cohort {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr double kMinDepth = 1e-6;
constexpr int kMinPoseInliers = 8;
constexpr double kMinPoseInlierRatio = 0.3;
constexpr std::size_t kMaxTriangulationRays = 12;
constexpr double kMinLossTurn = 0.7;  // in units of the noise
constexpr double kMaxLossTurn = 6.0;

}  // namespace

WorkingModel::WorkingModel(const WhitenedTracks& whitened, const Camera& camera)
    : whitened_(&whitened),
      cam_from_world_(whitened.frame_count()),
      centers_(whitened.frame_count()),
      rotations_(whitened.frame_count()),
      points_(whitened.track_count()),
      is_inlier_(whitened.observations().size(), 0) {
  SetCamera(camera);
}

WorkingModel::WorkingModel(const WhitenedTracks& whitened, const WorkingModel& other)
    : WorkingModel(whitened, other.camera()) {
  for (const int frame : other.RegisteredFrames()) SetPose(frame, other.Pose(frame));
}

WorkingModel::WorkingModel(const WhitenedTracks& some,
                           const WorkingModel& all,
                           const std::vector<int>& tracks)
    : WorkingModel(some, all) {
  noise_ = all.noise_;
  loss_turn_ = all.loss_turn_;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    points_[i] = all.points_[tracks[i]];
    std::copy(all.is_inlier_.begin() + all.whitened().TrackRange(tracks[i]).first,
              all.is_inlier_.begin() + all.whitened().TrackRange(tracks[i]).second,
              is_inlier_.begin() + some.TrackRange(static_cast<int>(i)).first);
  }
}

void WorkingModel::SetTracks(const WhitenedTracks& whitened) {
  whitened_ = &whitened;
  SetCamera(camera_);
}

void WorkingModel::SetCamera(const Camera& camera) {
  camera_ = camera;
  n_.resize(whitened_->observations().size());
  for (std::size_t i = 0; i < n_.size(); ++i) {
    n_[i] = camera_.Unproject(whitened_->observations()[i].xy);
  }
}

void WorkingModel::SetPose(int frame, const Rigid3& cam_from_world) {
  if (!HasPose(frame)) ++registered_;
  cam_from_world_[frame] = cam_from_world;
  rotations_[frame] = cam_from_world.rotation.toRotationMatrix();
  centers_[frame] = cam_from_world.Inverse().translation;
}

void WorkingModel::RemovePose(int frame) {
  if (!HasPose(frame)) return;
  cam_from_world_[frame].reset();
  --registered_;
  for (const int o : whitened_->ObservationsIn(frame)) is_inlier_[o] = 0;
}

int WorkingModel::RemoveUnsupportedPoses() {
  int removed = 0;
  for (const int frame : RegisteredFrames()) {
    const auto& observations = whitened_->ObservationsIn(frame);
    const auto inliers = std::count_if(
        observations.begin(), observations.end(), [this](int o) { return IsInlier(o); });
    if (inliers >= kMinPoseInliers) continue;
    RemovePose(frame);
    ++removed;
  }
  return removed;
}

std::vector<int> WorkingModel::RegisteredFrames() const {
  std::vector<int> frames;
  for (int f = 0; f < whitened_->frame_count(); ++f) {
    if (HasPose(f)) frames.push_back(f);
  }
  return frames;
}

std::vector<int> WorkingModel::NearestRegistered(int frame, std::size_t count) const {
  // Looks no further than it must: it is asked for every frame.
  std::vector<int> frames;
  for (int d = 0; d < whitened_->frame_count(); ++d) {
    for (const int f : {frame - d, frame + d}) {
      if (frames.size() == count) return frames;
      if (f < 0 || f >= whitened_->frame_count() || !HasPose(f)) continue;
      if (frames.empty() || frames.back() != f) frames.push_back(f);  // both are one if d is 0
    }
  }
  return frames;
}

std::size_t WorkingModel::CountPoints() const {
  return static_cast<std::size_t>(
      std::count_if(points_.begin(), points_.end(), [](const auto& p) { return p.has_value(); }));
}

int WorkingModel::CountVisiblePoints(int frame) const {
  int count = 0;
  for (const int o : whitened_->ObservationsIn(frame)) {
    if (HasPoint(whitened_->observations()[o].track)) ++count;
  }
  return count;
}

bool WorkingModel::RegisterFrame(int frame, const std::optional<Rigid3>& start) {
  std::vector<PointInFrame> points;
  for (const int o : whitened_->ObservationsIn(frame)) {
    const int track = whitened_->observations()[o].track;
    if (HasPoint(track)) points.push_back({Point(track), n_[o]});
  }
  if (static_cast<int>(points.size()) < kMinPoseInliers) return false;
  // Twice the final bound: poses and points of a growing model are not yet settled.
  const double max_error = 2.0 * kMaxReprojectionPx / MeanFocal();
  const auto pose = EstimateAbsolutePose(points, start, max_error);
  if (!pose || static_cast<int>(pose->inliers) < kMinPoseInliers ||
      static_cast<double>(pose->inliers) <
          kMinPoseInlierRatio * static_cast<double>(points.size())) {
    return false;
  }
  SetPose(frame, pose->cam_from_world);
  return true;
}

int WorkingModel::TriangulateTracks(std::span<const int> tracks) {
  const double max_error = kMaxReprojectionPx / MeanFocal();
  const std::size_t min_rays = MinViews();
  int found = 0;
  std::vector<Ray> rays;
  for (const int track : tracks) {
    if (HasPoint(track)) continue;
    const auto [first, last] = whitened_->TrackRange(track);
    rays.clear();
    for (int o = first; o < last; ++o) {
      const int frame = whitened_->observations()[o].frame;
      if (HasPose(frame)) rays.push_back({Pose(frame), n_[o]});
    }
    if (rays.size() < min_rays) continue;
    const std::vector<Ray> some = Spread(rays, std::min(rays.size(), kMaxTriangulationRays));
    const auto point = TriangulateRobustly(some, max_error, min_rays);
    if (!point) continue;
    SetPoint(track, point->in_world);
    UpdateInliers(std::array{track}, std::numeric_limits<double>::infinity());
    if (HasPoint(track)) ++found;
  }
  return found;
}

int WorkingModel::TriangulateAllTracks() {
  std::vector<int> tracks(whitened_->track_count());
  std::iota(tracks.begin(), tracks.end(), 0);
  return TriangulateTracks(tracks);
}

ModelAdjustment WorkingModel::Adjust(std::span<const int> free,
                                     std::span<const int> fixed,
                                     const BundleOptions& options,
                                     const std::vector<Eigen::Vector2d>& d_shift) {
  BundleProblem problem;
  problem.intrinsics = camera_;
  std::vector<int> camera_of_frame(whitened_->frame_count(), -1);
  std::vector<int> point_of_track(whitened_->track_count(), -1);
  ModelAdjustment adjustment;
  std::vector<int>& tracks = adjustment.tracks;
  const auto add_point = [&](int track) {
    point_of_track[track] = static_cast<int>(tracks.size());
    tracks.push_back(track);
    problem.points_in_world.push_back(Point(track));
  };
  if (free.empty()) {
    for (int track = 0; track < whitened_->track_count(); ++track) {
      if (HasPoint(track)) add_point(track);
    }
  }
  const auto add_frames = [&](std::span<const int> frames, bool is_fixed) {
    for (const int frame : frames) {
      camera_of_frame[frame] = static_cast<int>(problem.cameras.size());
      problem.cameras.push_back({Pose(frame), is_fixed});
      for (const int o : whitened_->ObservationsIn(frame)) {
        const int track = whitened_->observations()[o].track;
        // A point seen by fixed frames only teaches nothing about the others.
        if (is_fixed || !IsInlier(o) || !HasPoint(track)) continue;
        if (point_of_track[track] < 0) add_point(track);
      }
    }
  };
  add_frames(free, false);
  add_frames(fixed, true);
  // By point: the order in which the solver eliminates them.
  std::vector<std::pair<int, int>> by_point;  // and observation
  for (const std::span<const int> frames : {free, fixed}) {
    for (const int frame : frames) {
      for (const int o : whitened_->ObservationsIn(frame)) {
        const int point = point_of_track[whitened_->observations()[o].track];
        if (point >= 0 && IsInlier(o)) by_point.emplace_back(point, o);
      }
    }
  }
  std::sort(by_point.begin(), by_point.end());
  for (const auto& [point, o] : by_point) {
    const WhitenedObservation& observation = whitened_->observations()[o];
    problem.observations.push_back(
        {camera_of_frame[observation.frame], point, observation.xy, observation.covariance_px2});
    if (!d_shift.empty()) problem.observations.back().d_shift = d_shift[o];
  }
  if (problem.observations.empty()) return adjustment;
  adjustment.bundle = AdjustBundle(std::move(problem), options);
  const BundleResult& result = adjustment.bundle;
  if (result.termination == BundleTermination::kFailed) return adjustment;
  for (const int frame : free) {
    SetPose(frame, result.solution.cameras[camera_of_frame[frame]].cam_from_world);
  }
  for (const int track : tracks) {
    SetPoint(track, result.solution.points_in_world[point_of_track[track]]);
  }
  if (options.RefinesIntrinsics()) SetCamera(result.solution.intrinsics);
  return adjustment;
}

std::optional<Eigen::Vector2d> WorkingModel::PixelError(int observation) const {
  const WhitenedObservation& o = whitened_->observations()[observation];
  if (!HasPose(o.frame) || !HasPoint(o.track)) return std::nullopt;
  const Eigen::Vector3d x = rotations_[o.frame] * (*points_[o.track] - centers_[o.frame]);
  if (x.z() < kMinDepth) return std::nullopt;
  const std::optional<Eigen::Vector2d> xy = camera_.Project(x);
  if (!xy) return std::nullopt;
  return *xy - o.xy;
}

std::optional<double> WorkingModel::WhitenedError(int observation) const {
  const std::optional<Eigen::Vector2d> error = PixelError(observation);
  if (!error) return std::nullopt;
  return (whitened_->observations()[observation].whitening * *error).norm();
}

bool WorkingModel::IsSeenAtAngle(int track, double degrees) const {
  return IsSeenAtAngle(track, whitened_->TrackRange(track), degrees);
}

bool WorkingModel::IsSeenAtAngle(int track, std::pair<int, int> range, double degrees) const {
  // The widest pair, nearly: the ray farthest from the first, then the one farthest from that.
  const auto [first, last] = range;
  const Eigen::Vector3d& x = Point(track);
  const double min_angle = degrees * kDegree;
  std::optional<Eigen::Vector3d> from;
  for (int pass = 0; pass < 2; ++pass) {
    double widest = -1.0;
    Eigen::Vector3d widest_center = Eigen::Vector3d::Zero();
    for (int o = first; o < last; ++o) {
      if (!IsInlier(o)) continue;
      const Eigen::Vector3d& center = centers_[whitened_->observations()[o].frame];
      if (!from) from = center;
      const double angle = TriangulationAngle(x, *from, center);
      if (angle > widest) {
        widest = angle;
        widest_center = center;
      }
      if (widest >= min_angle) return true;
    }
    from = widest_center;
  }
  return false;
}

void WorkingModel::DropPoint(int track) {
  points_[track].reset();
  const auto [first, last] = whitened_->TrackRange(track);
  for (int o = first; o < last; ++o) is_inlier_[o] = 0;
}

int WorkingModel::UpdateInliers(std::span<const int> tracks, double max_error, double widen) {
  int changes = 0;
  for (const int track : tracks) {
    changes += UpdateInliersIn(track, whitened_->TrackRange(track), max_error, widen);
  }
  return changes;
}

void WorkingModel::UpdateInliersNear(int frame, double max_error) {
  // Tuned on the tuning clips: beyond, a growing model moves little from one frame to the next.
  constexpr int kReach = 200;
  for (const int o : whitened_->ObservationsIn(frame)) {
    const int track = whitened_->observations()[o].track;
    UpdateInliersIn(
        track, whitened_->RangeWithin(track, frame - kReach, frame + kReach), max_error);
  }
}

int WorkingModel::UpdateInliersIn(int track,
                                  std::pair<int, int> range,
                                  double max_error,
                                  double widen) {
  if (!HasPoint(track)) return 0;
  int changes = 0;
  int views = 0;
  for (int o = range.first; o < range.second; ++o) {
    bool inlier = false;
    const WhitenedObservation& observation = whitened_->observations()[o];
    if (HasPose(observation.frame)) {
      const std::optional<Eigen::Vector2d> error = PixelError(o);
      inlier = error && error->norm() <= widen * kMaxReprojectionPx &&
               (observation.whitening * *error).norm() <= max_error;
    }
    if (inlier) ++views;
    if (inlier != IsInlier(o)) ++changes;
    is_inlier_[o] = inlier ? 1 : 0;
  }
  if (views >= MinViews() && IsSeenAtAngle(track, range, kMinRayAngleDeg)) return changes;
  if (const auto all = whitened_->TrackRange(track); range != all) {
    views = static_cast<int>(
        std::count(is_inlier_.begin() + all.first, is_inlier_.begin() + all.second, 1));
    if (views >= MinViews() && IsSeenAtAngle(track, kMinRayAngleDeg)) return changes;
  }
  DropPoint(track);
  return changes + views;
}

void WorkingModel::MeasureNoise(std::vector<double>& squared) {
  double median = Median(squared);
  noise_ = std::sqrt(median / kMedianChiSquare2);
  // The shape of what is no gross outlier. Student's t in two dimensions with nu degrees of freedom
  // and scale s has P(q > x) = (1 + x / (nu s^2))^(-nu / 2), so of its quartiles q2, q3
  //   nu s^2 = q2^2 / (q3 - 2 q2),
  // and its negative log likelihood is Cauchy's loss with the scale sqrt(nu) s.
  std::erase_if(squared, [limit = 36.0 * median](double q) { return q > limit; });
  std::sort(squared.begin(), squared.end());
  median = squared[squared.size() / 2];
  const double excess = squared[squared.size() * 3 / 4] - 2.0 * median;
  const double turn = excess > 0.0 ? median / std::sqrt(excess) : kMaxLossTurn * noise_;
  loss_turn_ = std::clamp(turn, kMinLossTurn * noise_, kMaxLossTurn * noise_);
}

int WorkingModel::UpdateAllInliers(double max_error) {
  std::vector<double> squared;
  squared.reserve(whitened_->observations().size());
  for (int o = 0; o < static_cast<int>(whitened_->observations().size()); ++o) {
    const WhitenedObservation& observation = whitened_->observations()[o];
    if (!HasPose(observation.frame) || !HasPoint(observation.track)) continue;
    if (const auto error = WhitenedError(o)) squared.push_back(*error * *error);
  }
  if (!squared.empty()) MeasureNoise(squared);
  std::vector<int> tracks(whitened_->track_count());
  std::iota(tracks.begin(), tracks.end(), 0);
  return UpdateInliers(tracks, max_error);
}

double WorkingModel::ErrorBound() const { return std::max(4.0 * noise_, 0.02); }

double WorkingModel::TruncatedCost(std::span<const int> frames, double bound) const {
  double cost = 0.0;
  for (const int frame : frames) {
    for (const int o : whitened_->ObservationsIn(frame)) {
      const int track = whitened_->observations()[o].track;
      std::optional<double> error;
      if (HasPose(frame) && HasPoint(track)) error = WhitenedError(o);
      cost += error ? std::min(*error * *error, bound * bound) : bound * bound;
    }
  }
  return cost;
}

double WorkingModel::MedianError(int frame) const {
  std::vector<double> errors;
  for (const int o : whitened_->ObservationsIn(frame)) {
    if (!IsInlier(o)) continue;
    if (const auto error = WhitenedError(o)) errors.push_back(*error);
  }
  return Median(std::move(errors));
}

double WorkingModel::MedianDepthUncertainty() const {
  constexpr double kNearRayAngleDeg = 0.5;
  // The noise is in units of what the observations say of themselves.
  const double noise = noise_ / MeanFocal();
  std::vector<double> values;
  for (int t = 0; t < whitened_->track_count(); ++t) {
    if (!HasPoint(t) || !IsSeenAtAngle(t, kNearRayAngleDeg)) continue;
    // Each ray leaves the point free along itself only.
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    double nearest = std::numeric_limits<double>::infinity();
    const auto [first, last] = whitened_->TrackRange(t);
    for (int o = first; o < last; ++o) {
      if (!IsInlier(o)) continue;
      const WhitenedObservation& observation = whitened_->observations()[o];
      const Eigen::Vector3d ray = Point(t) - centers_[observation.frame];
      const double distance = ray.norm();
      nearest = std::min(nearest, distance);
      const Eigen::Vector3d u = ray / distance;
      const double sigma = distance * std::sqrt(0.5 * observation.covariance_px2.trace());
      information += (Eigen::Matrix3d::Identity() - u * u.transpose()) / (sigma * sigma);
    }
    const double weakest =
        Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(information).eigenvalues()[0];
    values.push_back(noise / std::sqrt(std::max(weakest, 1e-300)) / nearest);
  }
  return values.empty() ? std::numeric_limits<double>::infinity() : Median(std::move(values));
}

void WorkingModel::Normalise() {
  const std::vector<int> frames = RegisteredFrames();
  if (frames.empty()) return;
  const Rigid3 origin = Pose(frames.front());
  std::vector<double> distances;
  for (const auto& point : points_) {
    if (point) distances.push_back((origin * *point).norm());
  }
  const double scale = distances.empty() ? 1.0 : 1.0 / Median(std::move(distances));
  const Rigid3 world_from_cam = origin.Inverse();
  for (const int frame : frames) {
    Rigid3 pose = Pose(frame) * world_from_cam;
    pose.translation *= scale;
    SetPose(frame, pose);
  }
  SetPose(frames.front(), Rigid3{});
  for (auto& point : points_) {
    if (point) *point = scale * (origin * *point);
  }
}

ComparedCosts CompareCosts(const WorkingModel& a,
                           const WorkingModel& b,
                           std::span<const int> frames) {
  const double bound = std::min(a.ErrorBound(), b.ErrorBound());
  return {a.TruncatedCost(frames, bound), b.TruncatedCost(frames, bound)};
}

bool IsWorse(double larger_cost, double cost, double noise) {
  constexpr double kEvidence = 20.0;  // twice the difference of the logarithms of likelihoods
  const double variance = std::max(noise, kMinWhitenedNoise) * std::max(noise, kMinWhitenedNoise);
  return larger_cost - cost > kEvidence * variance;
}

}  // namespace cohort
