#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "backend/scene/lens_changes.h"
#include "backend/scene/mapper_termination.h"
#include "backend/scene/reconstruction.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

struct MapperOptions {
  int min_track_length = 3;
  bool use_covariances = true;
  double covariance_floor_px = 0.1;
  bool include_predicted = false;
  double predicted_growth_px = 1.0;
  bool refine_focal = true;
  bool refine_radial = true;
  bool refine_principal_point = true;
  double readout = 0.0;
  bool estimate_readout = true;
  bool covariances = false;
  // For a model that is only to predict where features are seen (the second pass): it is not brought to its
  // minimum, and less is asked what is to be thought of it.
  bool draft = false;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("min_track_length",
             o.min_track_length,
             2,
             1000,
             "tracks observed in fewer frames are not used [frames]");
    v.Flag("use_covariances",
           o.use_covariances,
           "Weigh every observation by how sure the tracker is of it; off: all alike.",
           Tier::kCommon);
    v.Number("covariance_floor_px",
             o.covariance_floor_px,
             0.0,
             10.0,
             "added in quadrature to a tracker's standard deviation, so that no observation claims "
             "to be exact [px]");
    v.Flag("include_predicted",
           o.include_predicted,
           "Use positions that no image confirmed too, with less weight. They hold on to "
           "the other features alone, so a model of them confirms itself.",
           Tier::kCommon);
    v.Number("predicted_growth_px",
             o.predicted_growth_px,
             0.01,
             100.0,
             "standard deviation that a predicted position gains with every frame [px]");
    v.Flag("refine_focal",
           o.refine_focal,
           "Refine the focal length of a guessed camera; off: the guess is taken as true.",
           Tier::kCommon);
    v.Flag("refine_radial", o.refine_radial, "refine k1 and k2 of a guessed camera");
    v.Flag("refine_principal_point",
           o.refine_principal_point,
           "Refine the principal point of a guessed camera too. It stays within a few per cent of "
           "the picture's middle, as those of real cameras do; off: it is the middle.",
           Tier::kCommon);
    v.Number("readout",
             o.readout,
             -1.0,
             1.0,
             "Rolling shutter: the share of the time between frames from the first row to the "
             "last; negative from the bottom up. 0: --ceres.estimate-readout says.",
             Tier::kCommon);
    v.Flag(
        "estimate_readout",
        o.estimate_readout,
        "Find the rolling shutter's readout from the tracks, where --ceres.readout does not give "
        "it; off: without one the shutter is global.",
        Tier::kCommon);
    v.Flag("covariances",
           o.covariances,
           "Estimate the covariances of cameras and points, which takes memory with the "
           "square of the number of frames.",
           Tier::kCommon);
  }
};

struct MapperResult {
  MapperTermination termination = MapperTermination::kTooFewTracks;
  Reconstruction reconstruction;         // empty unless kSuccess or kPartial
  ReconstructionSummary summary;         // its termination says in words how it ended
  std::vector<FeatureId> without_point;  // features with an observation, but no point in the model
  // Parts of the clip that could not be tied to the model returned, most frames first.
  std::vector<Reconstruction> other_parts;
  // Standard deviation of an observation's coordinate [px], robust; where covariances are used, in
  // units of theirs: 1 if they are right.
  double noise = 0.0;
  // Of the model returned, or, where none is of worth, of the largest part: how well it knows depths (median of their
  // deviations, relative), and how much of the parallax it leaves (UnexplainedParallax).
  double depth_uncertainty = 0.0;
  double unexplained_parallax = 0.0;
  // Where the tracks contradict a camera that was given as known: the one they ask for.
  std::optional<Camera> better_camera;
  // With MapperOptions::covariances: the root mean square error of the cameras that is expected, as a
  // share of that distance of them from their mean, and the relative standard deviation of a focal
  // length that was refined (judgement.h says how both follow from the covariances).
  std::optional<double> expected_error;
  std::optional<double> focal_sigma;
  std::optional<LensChanges> lens_changes;  // of the model returned
  // With MapperOptions::covariances, scaled by noise^2: of (omega [rad], centre), see CameraPose.
  std::map<FrameIndex, Eigen::Matrix<double, 6, 6>> camera_covariances;
  std::map<FeatureId, Eigen::Matrix3d> point_covariances;
  std::vector<std::string> warnings;  // what was asked for and could not be done, a line each
};

// Cameras and points from tracks alone. The camera is the file's; refined if it is a guess, and
// guessed where there is none. Exploits that it is video: keyframes grow the model, each from its
// neighbour's pose; the other frames follow by pose alone, and one bundle adjustment of everything
// ends it. A clip that gives no model is a result (termination), not an error. Throws Error on
// input that makes no sense (no picture size, intrinsics that are not positive).
MapperResult ReconstructWithCeres(const TrackFile& file, const MapperOptions& options = {});

// A model adjusted to other tracks of its clip: poses of `start`, points anew, then all together.
// Keeps the camera, which takes every frame for one moment, and registers no frame that `start` has
// not.
Reconstruction AdjustWithCeres(const TrackFile& file, const Reconstruction& start);
// The same to the end, as a reconstruction is: with the readout of a rolling shutter, the camera of
// `start` refined if it is a guess, and all that is said of a model, though it may be worth nothing
// (summary.reasons). In a world of its own.
MapperResult AdjustAndJudgeWithCeres(const TrackFile& file,
                                     const Reconstruction& start,
                                     const MapperOptions& options = {});

// Points alone, from poses that are given and kept (true ones: isolates the tracks from the
// solver): triangulation, then bundle adjustment that moves nothing but points, under the bounds of
// the mapper. All frames with a pose count as registered; the camera of `file` must be known.
MapperResult TriangulateWithCeres(const TrackFile& file,
                                  const std::map<FrameIndex, Rigid3>& cam_from_world,
                                  const MapperOptions& options = {});

}  // namespace cohort
