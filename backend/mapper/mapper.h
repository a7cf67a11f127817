#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "backend/adjust/lens_changes.h"
#include "backend/scene/mapper_termination.h"
#include "backend/scene/reconstruction.h"
#include "backend/scene/whitened_tracks.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

struct MapperOptions {
  WhiteningOptions whitening = {};
  bool refine_focal = true;
  bool refine_radial = true;
  bool refine_principal_point = true;
  double readout = 0.0;
  bool estimate_readout = true;
  bool covariances = true;
  // For a model that only predicts where features are seen (the second pass): it is not adjusted to
  // its minimum, and fewer of the checks for doubts run.
  bool draft = false;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("min_track_length",
             o.whitening.min_track_length,
             2,
             1000,
             "minimum number of frames in which a track must be observed to be used");
    v.Flag("use_covariances",
           o.whitening.use_covariances,
           "Weight every observation by the covariance that the tracker gives it; off: weight all "
           "equally.",
           Tier::kCommon);
    v.Number("covariance_floor_px",
             o.whitening.covariance_floor_px,
             0.0,
             10.0,
             "standard deviation that is added in quadrature to that of the tracker, so that no "
             "observation counts as exact [px]");
    v.Flag("refine_focal",
           o.refine_focal,
           "Refine the focal length of a guessed camera; off: keep the guess.",
           Tier::kCommon);
    v.Flag("refine_radial", o.refine_radial, "refine k1 and k2 of a guessed camera");
    v.Flag("refine_principal_point",
           o.refine_principal_point,
           "Refine the principal point of a guessed camera too. A prior keeps it within a few per "
           "cent of the picture's middle, as in real cameras; off: it is the middle.",
           Tier::kCommon);
    v.Number("readout",
             o.readout,
             -1.0,
             1.0,
             "The readout of a rolling shutter: the time from the first row to the last, as a "
             "share of the time between frames; negative if the rows are read from the bottom up. "
             "0: not known, see --ceres.estimate-readout.",
             Tier::kCommon);
    v.Flag("estimate_readout",
           o.estimate_readout,
           "Estimate the rolling shutter's readout from the tracks if --ceres.readout does not "
           "give it; off: without --ceres.readout the shutter is global.",
           Tier::kCommon);
    v.Flag("covariances",
           o.covariances,
           "Estimate the covariances of cameras and points, and from them the expected error of "
           "the cameras, by which the model is judged. Models of more than 600 frames have none.",
           Tier::kCommon);
  }
};

// What a reconstruction by Ceres finds besides the model.
struct CeresFindings {
  std::vector<FeatureId> without_point;  // observed features that have no point in the model
  // Parts of the clip that could not be connected to the model returned, most frames first.
  std::vector<Reconstruction> other_parts;
  // Robust standard deviation of an observation's coordinate [px]. With covariances, relative to
  // theirs: 1 if they are right.
  double noise = 0.0;
  // The median relative standard deviation of the depths, and the share of unexplained parallax
  // (UnexplainedParallax), of the returned model, or of the largest part if none is good enough.
  double depth_uncertainty = 0.0;
  double unexplained_parallax = 0.0;
  // The camera that the tracks imply, if they contradict one that was given as known.
  std::optional<Camera> better_camera;
  // With MapperOptions::covariances: the expected root mean square error of the cameras, as a share
  // of their root mean square distance from their mean, and the relative standard deviation of a
  // refined focal length (judgement.h states how both follow from the covariances).
  std::optional<double> expected_error;
  std::optional<double> focal_sigma;
  // With MapperOptions::covariances, scaled by noise^2. The cameras' are those of (omega [rad],
  // centre), see CameraPose.
  std::map<FrameIndex, Eigen::Matrix<double, 6, 6>> camera_covariances;
  std::map<FeatureId, Eigen::Matrix3d> point_covariances;
};

struct MapperResult : CeresFindings {
  MapperTermination termination = MapperTermination::kTooFewTracks;
  Reconstruction reconstruction;            // empty unless kSuccess or kPartial
  ReconstructionSummary summary;            // its termination describes how it ended
  std::optional<LensChanges> lens_changes;  // of the model returned
  std::vector<std::string> warnings;        // requests that could not be met, one line each
};

// Reconstructs cameras and points from tracks alone. The camera is the file's; it is refined if it
// is a guess, and guessed if there is none. The mapper exploits that the input is video: keyframes
// grow the model, each from its neighbour's pose, the other frames follow by pose alone, and one
// bundle adjustment of everything finishes it. A clip that gives no model is a result
// (termination), not an error. Throws Error on invalid input (no picture size, intrinsics that are
// not positive).
MapperResult ReconstructWithCeres(const TrackFile& file, const MapperOptions& options = {});

// Adjusts a model to other tracks of its clip: poses of `start`, new points, then all together.
// Keeps the camera, treats the shutter as global, and registers no frame that `start` lacks.
Reconstruction AdjustWithCeres(const TrackFile& file, const Reconstruction& start);
// The same as a complete reconstruction: with the rolling shutter's readout, the camera of `start`
// refined if it is a guess, and all judgements of a model, even a worthless one (summary.reasons).
// The result has its own world frame.
MapperResult AdjustAndJudgeWithCeres(const TrackFile& file,
                                     const Reconstruction& start,
                                     const MapperOptions& options = {});

// Estimates only the points, from given and fixed poses (true poses isolate the tracks from the
// solver): triangulation, then bundle adjustment of the points alone, within the mapper's bounds.
// All frames with a pose count as registered; the camera of `file` must be known.
MapperResult TriangulateWithCeres(const TrackFile& file,
                                  const std::map<FrameIndex, Rigid3>& cam_from_world,
                                  const MapperOptions& options = {});

}  // namespace cohort
