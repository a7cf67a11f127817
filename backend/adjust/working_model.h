#pragma once

#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "backend/adjust/bundle_adjustment.h"
#include "backend/scene/reconstruction.h"
#include "backend/scene/whitened_tracks.h"

namespace cohort {

inline constexpr double kInfinity = std::numeric_limits<double>::infinity();
// The smallest accepted value of a point's largest ray angle [deg]; COLMAP's 1.5 is for
// photographs. A model of near points alone loses its scale if the camera moves ahead and the
// tracks are short, because the far points that remain are those that noise made near.
inline constexpr double kMinRayAngleDeg = 0.1;
// The smallest noise of a whitened coordinate; a smaller one means a clip without noise.
inline constexpr double kMinWhitenedNoise = 0.02;

// `count` of these, two or more, evenly spread from the first to the last.
template <typename T>
std::vector<T> Spread(const std::vector<T>& all, std::size_t count) {
  std::vector<T> some;
  for (std::size_t i = 0; i < count; ++i) some.push_back(all[i * (all.size() - 1) / (count - 1)]);
  return some;
}

struct ModelAdjustment {
  BundleResult bundle;      // its cameras: the free frames, then the fixed ones
  std::vector<int> tracks;  // the tracks of the bundle's points, in their order
};

// A reconstruction in progress: which frames have a pose, which tracks have a point, and which of
// their observations are inliers.
class WorkingModel {
 public:
  WorkingModel(const WhitenedTracks& whitened, const Camera& camera);
  // Takes camera and poses from a model of other tracks in the same frames; no points.
  WorkingModel(const WhitenedTracks& whitened, const WorkingModel& other);
  // The model of these tracks alone; `some` is its whitened().Select(tracks).
  WorkingModel(const WhitenedTracks& some, const WorkingModel& all, const std::vector<int>& tracks);

  const WhitenedTracks& whitened() const { return *whitened_; }
  // Replaces the observations by the same ones at other positions (WhitenedTracks::WithPositions).
  void SetTracks(const WhitenedTracks& whitened);
  const Camera& camera() const { return camera_; }
  void SetCamera(const Camera& camera);
  // The normalised image point of an observation under the present camera.
  const Eigen::Vector2d& Normalised(int observation) const { return n_[observation]; }
  double MeanFocal() const { return 0.5 * (camera_.fx + camera_.fy); }

  bool HasPose(int frame) const { return cam_from_world_[frame].has_value(); }
  const Rigid3& Pose(int frame) const { return *cam_from_world_[frame]; }
  void SetPose(int frame, const Rigid3& cam_from_world);
  // Removes the frame's pose; its observations are no longer inliers.
  void RemovePose(int frame);
  // Removes poses with fewer inliers than RegisterFrame requires. Returns how many.
  int RemoveUnsupportedPoses();
  std::vector<int> RegisteredFrames() const;  // ascending
  int registered() const { return registered_; }
  // At most `count` registered frames by distance in time, the frame itself first.
  std::vector<int> NearestRegistered(int frame, std::size_t count) const;

  bool HasPoint(int track) const { return points_[track].has_value(); }
  const Eigen::Vector3d& Point(int track) const { return *points_[track]; }
  void SetPoint(int track, const std::optional<Eigen::Vector3d>& in_world) {
    points_[track] = in_world;
  }
  std::size_t CountPoints() const;
  bool IsInlier(int observation) const { return is_inlier_[observation] != 0; }

  // Robust standard deviation of a whitened coordinate; 1 before there is a model.
  double noise() const { return noise_; }
  // The scale at which Cauchy's loss is the likelihood of the whitened residuals: near the noise if
  // their tails are heavy, far from it if they are Gaussian.
  double loss_turn() const { return loss_turn_; }

  // Observations of tracks with a point in this frame.
  int CountVisiblePoints(int frame) const;
  // Finds the pose of a frame from the points it sees. Returns false if too few of them agree.
  bool RegisterFrame(int frame, const std::optional<Rigid3>& start);
  // Triangulates tracks without a point that registered frames see at a sufficient angle.
  int TriangulateTracks(std::span<const int> tracks);
  int TriangulateAllTracks();

  // Bundle adjustment of the registered frames `free` and the points they see, from observations in
  // them and in the registered frames `fixed`, which keep their poses; without free frames, of all
  // points alone. Refined intrinsics become the model's. `d_shift`: of all observations, where
  // options refine a shift.
  ModelAdjustment Adjust(std::span<const int> free,
                         std::span<const int> fixed,
                         const BundleOptions& options,
                         const std::vector<Eigen::Vector2d>& d_shift = {});

  // Updates the inliers, and measures the noise. An observation further than max_error (whitened)
  // or kMaxReprojectionPx off is an outlier; points behind a camera, seen at too small an angle or
  // by fewer than three frames (two in a model of two) are dropped. Returns how many observations
  // changed. `widen` scales the bound in pixels, for a start that is known to be rough.
  int UpdateInliers(std::span<const int> tracks, double max_error, double widen = 1.0);
  int UpdateAllInliers(double max_error);
  // Updates the frame's tracks, but only their observations in frames near it, which bounds the
  // time.
  void UpdateInliersNear(int frame, double max_error);
  // The bound on whitened errors that fits the current noise.
  double ErrorBound() const;

  // Sum over all observations in `frames` of min(|whitened error|^2, bound^2). An observation
  // without a point or pose counts as bound^2, which makes models of the same frames comparable.
  double TruncatedCost(std::span<const int> frames, double bound) const;

  // Projection minus observation [px]; nullopt behind the camera or without a pose or a point.
  std::optional<Eigen::Vector2d> PixelError(int observation) const;

  // Median of the inliers' whitened errors in a frame; 0 without any.
  double MedianError(int frame) const;

  // Median over near points of the standard deviation of depth, relative to the distance.
  double MedianDepthUncertainty() const;

  // Normalises the world: the first registered frame is its origin, and the median distance of the
  // points from it is 1.
  void Normalise();

 private:
  std::optional<double> WhitenedError(int observation) const;
  bool IsSeenAtAngle(int track, double degrees) const;
  bool IsSeenAtAngle(int track, std::pair<int, int> range, double degrees) const;
  int UpdateInliersIn(int track, std::pair<int, int> range, double max_error, double widen = 1.0);
  int MinViews() const { return registered_ >= 3 ? 3 : 2; }
  void DropPoint(int track);
  void MeasureNoise(std::vector<double>& squared_errors);

  const WhitenedTracks* whitened_;
  Camera camera_;
  std::vector<Eigen::Vector2d> n_;
  std::vector<std::optional<Rigid3>> cam_from_world_;
  std::vector<Eigen::Vector3d> centers_;  // of frames with a pose
  std::vector<Eigen::Matrix3d> rotations_;
  std::vector<std::optional<Eigen::Vector3d>> points_;
  std::vector<char> is_inlier_;
  int registered_ = 0;
  double noise_ = 1.0;
  double loss_turn_ = 2.0;
};

// TruncatedCost of two models over the same frames, with the lower of their ErrorBounds.
struct ComparedCosts {
  double a = 0.0;
  double b = 0.0;
};
ComparedCosts CompareCosts(const WorkingModel& a,
                           const WorkingModel& b,
                           std::span<const int> frames);

// Whether a truncated cost exceeds another by more than noise (of a whitened coordinate) explains.
bool IsWorse(double larger_cost, double cost, double noise);

}  // namespace cohort
