#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "backend/scene/whitened_tracks.h"
#include "frontend/core/options.h"
#include "frontend/geometry/camera.h"
#include "frontend/geometry/rigid3.h"
#include "frontend/tracks/track_set.h"

namespace cohort {

// The features that two frames share and their positions in each [px]; same length, ascending
// features.
struct FramePairMatches {
  std::vector<FeatureId> features;
  std::vector<Eigen::Vector2d> xy1;
  std::vector<Eigen::Vector2d> xy2;
};

// Observed positions only.
FramePairMatches MatchFrames(const TrackSet& tracks, FrameIndex frame1, FrameIndex frame2);

enum class TwoViewKind {
  kCalibrated,    // an essential matrix, and enough depth to exclude a homography
  kUncalibrated,  // the same with a fundamental matrix: the camera is a guess
  kPlanar,        // a homography explains the pair as well: a plane, or nearly one
  kPanoramic,     // a rotation alone explains the pair: no parallax, no translation
  kDegenerate,    // no geometry holds for enough matches
};
inline constexpr ChoiceNames<TwoViewKind, 5> kTwoViewKindNames{
    {{"calibrated", TwoViewKind::kCalibrated},
     {"uncalibrated", TwoViewKind::kUncalibrated},
     {"planar", TwoViewKind::kPlanar},
     {"panoramic", TwoViewKind::kPanoramic},
     {"degenerate", TwoViewKind::kDegenerate}}};

struct TwoViewOptions {
  double max_error_px = 4.0;  // Sampson distance of an inlier; COLMAP's bound, no option
  int min_inliers = 15;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("min_inliers",
             o.min_inliers,
             8,
             10000,
             "matches that must agree with a pair's geometry, or the pair is left out");
  }
};

// The geometry of two views of a rigid scene. E acts on normalised image points, F and H on pixels
// of the undistorted pinhole camera (same fx fy cx cy): x2' E x1 = 0, x2 ~ H x1.
struct TwoViewGeometry {
  TwoViewKind kind = TwoViewKind::kDegenerate;
  // For each match: it agrees with the geometry and, if there is a relative pose of a known camera,
  // lies in front of both cameras.
  std::vector<bool> inlier;
  std::size_t inlier_count = 0;
  std::optional<Rigid3> cam2_from_cam1;        // |translation| = 1; unset: panoramic, degenerate
  std::optional<Eigen::Matrix3d> essential;    // [t]x R, if there is a relative pose
  std::optional<Eigen::Matrix3d> fundamental;  // if there is a pose or the kind is uncalibrated
  std::optional<Eigen::Matrix3d> homography;   // if one fits at least min_inliers
  // Medians over the inliers.
  double angle_deg = 0.0;         // between the two rays of a point (triangulation angle)
  double motion_px = 0.0;         // |x2 - x1|
  double parallax_px = 0.0;       // what remains of the motion after the best rotation
  double error_px = 0.0;          // Sampson distance
  double homography_ratio = 0.0;  // share of the inliers that the homography explains too
};

// Robust estimation (OpenCV's USAC: MAGSAC++ with a fixed random state, then a refinement of the
// relative pose by its Sampson distances); deterministic. Throws Error on lists of unequal length.
TwoViewGeometry EstimateTwoViewGeometry(std::span<const Eigen::Vector2d> xy1,
                                        std::span<const Eigen::Vector2d> xy2,
                                        const Camera& camera,
                                        const TwoViewOptions& options = {});

// The same of two frames' common tracks, from 8 inliers on. The focal length is a hypothesis: the
// camera counts as known.
TwoViewGeometry EstimateTwoViewGeometry(const WhitenedTracks& whitened,
                                        int frame_a,
                                        int frame_b,
                                        Camera camera,
                                        double max_error_px = TwoViewOptions{}.max_error_px);

Eigen::Matrix3d EssentialFromPose(const Rigid3& cam2_from_cam1);  // [t]x R

}  // namespace cohort
