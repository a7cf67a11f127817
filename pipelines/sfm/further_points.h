#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <map>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <vector>

#include "backend/geometry/weighted_triangulation.h"
#include "backend/scene/near_world.h"
#include "backend/scene/reconstruction.h"
#include "backend/scene/row_poses.h"
#include "frontend/image/exposure.h"
#include "frontend/image/frame.h"
#include "frontend/track/measure/measurement.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

struct FurtherPoint {
  Point3D point;
  // Standard deviation of its position for exact cameras, as a share of its distance from the
  // camera that saw it first.
  double uncertainty = 0.0;
  Eigen::Vector3d bgr = Eigen::Vector3d::Zero();  // mean over its views, 0..255
};

// Points in addition to those of a finished reconstruction, whose cameras stay as they are. Corners
// between its points are followed through keyframes, each on its own: its depth, at first that of
// the points around it, predicts where the next keyframe shows it. Its patch is measured there
// (MeasurePatch), and the point is triangulated again from all of its measurements.
//
//   FurtherPoints further(file, model, keyframes, wanted);
//   for each keyframe: further.Follow(frame, bgr);
//   std::map<FeatureId, FurtherPoint> points = further.Finish();
//
// A point is kept if it was measured in at least five keyframes, if three quarters of these and at
// least five agree with one rigid point to within their noise, and if it is as certain as nine
// tenths of the reconstruction's own points. Memory grows with the corners that are followed at a
// time, not with the pictures.
class FurtherPoints {
 public:
  // `keyframes`: registered frames, ascending. `file` and `model` must outlive this.
  FurtherPoints(const TrackFile& file,
                const Reconstruction& model,
                std::span<const FrameIndex> keyframes,
                std::size_t wanted);

  // The next keyframe, and its picture as CV_8UC3. Nothing is measured where its mask is black.
  void Follow(Frame frame, const cv::Mat& bgr);
  // At most `wanted` points, the most certain ones. Their ids follow those of the file's features.
  std::map<FeatureId, FurtherPoint> Finish();

 private:
  struct Sighting {
    FrameIndex frame{};
    Eigen::Vector2d xy = Eigen::Vector2d::Zero();
    Eigen::Matrix2d shape = Eigen::Matrix2d::Identity();  // covariance up to a factor [px^2]
    cv::Vec3b bgr;
  };
  // A corner that is followed. The first sighting is where it was detected.
  struct Corner {
    std::vector<Sighting> sightings;
    AnchorPatch anchor;  // of the first sighting
    Rigid3 cam_from_world;
    std::size_t first_keyframe = 0;
    double nearest = 0.0;  // where it may be, along the optical axis of the first sighting
    double farthest = 0.0;
    Eigen::Vector3d in_world = Eigen::Vector3d::Zero();
    double depth_sigma = 0.0;  // 0: it may be anywhere in between
    int window_px = 0;         // 0: not chosen yet
    Eigen::Matrix2d beyond_prediction = Eigen::Matrix2d::Identity();  // of the warp
    int misses = 0;                                                   // in a row
  };
  // A corner that was followed to its end, or a point of the reconstruction.
  struct Candidate {
    std::vector<Sighting> sightings;
    Eigen::Vector3d in_world = Eigen::Vector3d::Zero();
  };
  struct Measured {
    Measurement m;
    int window_px = 0;
    Eigen::Matrix2d beyond_prediction = Eigen::Matrix2d::Identity();
  };
  struct Estimate {
    std::optional<EstimatedPoint> point;
    // Of each sighting: the squared distance from the point, in units of its shape, for the degrees
    // of freedom that the point leaves.
    std::vector<double> mahalanobis2;
    double uncertainty = 0.0;  // FurtherPoint's, up to the same factor
  };

  std::optional<Eigen::Vector2d> Project(const Eigen::Vector3d& in_world, FrameIndex frame) const;
  std::vector<WeightedRay> RaysOf(std::span<const Sighting> sightings) const;
  bool IsDue(const Corner& corner) const;
  void MeasureCorners(const Pyramid& smooth, const Frame& frame, const cv::Mat& bgr);
  std::optional<Measured> MeasureFirst(const Corner& corner,
                                       const Pyramid& smooth,
                                       FrameIndex frame) const;
  std::optional<Measured> Measure(const Corner& corner,
                                  const Pyramid& smooth,
                                  FrameIndex frame,
                                  const Eigen::Vector3d& in_world,
                                  int window_px) const;
  // The distance of a position from where the frame can show the corner [px].
  double DistanceFromSegment(const Corner& corner,
                             FrameIndex frame,
                             const Eigen::Vector2d& xy) const;
  void Take(Corner& corner, const Measured& measured, FrameIndex frame, const cv::Mat& bgr) const;
  // Those missed for too long become candidates, if they were measured often enough.
  void EndCorners(int most_misses);
  void Detect(const Pyramid& raw, const Pyramid& smooth, const Frame& frame, const cv::Mat& bgr);
  // How many corners to look for in this keyframe.
  int CornersWanted() const;
  std::vector<Eigen::Vector2d> NewCorners(const Pyramid& raw,
                                          const Pyramid& smooth,
                                          const cv::Mat& mask,
                                          std::vector<Eigen::Vector2d> occupied,
                                          int wanted) const;
  Estimate EstimateFrom(const Candidate& candidate) const;
  std::vector<Estimate> EstimateAll(std::span<const Candidate> candidates) const;
  double UncertaintyOfTrackedPoints() const;

  const TrackFile& file_;
  NearModel near_;
  const Reconstruction& model_;  // the near one
  RowPoses rows_;
  std::vector<FrameIndex> keyframes_;
  std::size_t wanted_;
  std::vector<double> seen_share_;  // by keyframe: of the model's points, those seen up to it
  std::map<FrameIndex, std::vector<FeatureId>> known_in_;  // the model's points, by keyframe
  Exposure exposure_;
  std::size_t now_ = 0;  // the keyframe's number
  std::vector<Corner> corners_;
  std::vector<Candidate> candidates_;
  std::size_t detected_ = 0;
};

}  // namespace cohort
