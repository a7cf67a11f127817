#pragma once

#include <filesystem>
#include <map>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "backend/colmap/model_tracks.h"
#include "backend/mapper/mapper.h"
#include "datasets/readers/sequence.h"
#include "frontend/core/options.h"
#include "pipelines/sfm/progress.h"
#include "pipelines/sfm/reconstruct.h"
#include "pipelines/sfm/second_pass.h"

namespace cohort {

enum class IntrinsicsMode { kAuto, kKeep, kRefine };
inline constexpr ChoiceNames<IntrinsicsMode, 3> kIntrinsicsModeNames{
    {{"auto", IntrinsicsMode::kAuto},
     {"keep", IntrinsicsMode::kKeep},
     {"refine", IntrinsicsMode::kRefine}}};

struct RefineModelOptions {
  IntrinsicsMode intrinsics = IntrinsicsMode::kAuto;
  bool drop_contradicted = true;
  double model_max_distance_px = 5.0;  // replaces the second pass's own
  SecondPassOptions second_pass;
  MapperOptions ceres;

  // All but the second pass.
  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Choice(
        "intrinsics",
        o.intrinsics,
        kIntrinsicsModeNames,
        "How the camera of a COLMAP model is treated. auto refines a camera with a single focal "
        "length (SIMPLE_PINHOLE, SIMPLE_RADIAL, RADIAL), the kind that COLMAP estimates itself, "
        "and keeps any other, the kind that calibrations give, unless the tracks contradict it.",
        Tier::kCommon);
    v.Flag("drop_contradicted",
           o.drop_contradicted,
           "Drop the points of a COLMAP model that its pictures contradict: those that are found "
           "again in none of them, or that are not where half of their observations are. They lie "
           "on depth discontinuities or reflections, or are false matches.",
           Tier::kCommon);
    v.Number("model_max_distance_px",
             o.model_max_distance_px,
             0.1,
             50.0,
             "--max-distance-px for a COLMAP model, which is less accurate than a model made from "
             "the tracks [px]");
    v.Group("ceres", o.ceres, "adjustment of a COLMAP model");
  }
};

struct RefinedModel {
  ColmapModel model;             // with the ids, names, colours and world of the input
  TrackFile file;                // its tracks, measured again; feature = point id - 1 (ModelOfClip)
  ReconstructResult adjusted;    // the same model, by frames and features, with its findings
  ReconstructionSummary before;  // figures of the input, for the frames of the clip
  SecondPassFigures found;       // of the input's tracks
  std::size_t contradicted = 0;  // points that were dropped
  bool camera_refined = false;
  std::vector<FrameInfo> frames;                  // of the clip
  std::map<FrameIndex, ColmapImageId> image_ids;  // of the frames that have an image
  std::vector<std::string> notes;                 // lines for the user
};

// Refines a COLMAP model of a clip, by any program: measures its points again where it predicts
// them (MeasureAgain) and adjusts it to the result until it no longer moves. Drops points that the
// pictures contradict, unless a frame would keep too few. Images are matched to frames by name;
// others are left out. Throws Error naming `path` (the model) or the clip if they do not belong
// together: too few points are found again where the model predicts them.
RefinedModel RefineModel(const ColmapModel& model,
                         const std::filesystem::path& path,
                         Sequence& sequence,
                         const RefineModelOptions& options = {},
                         const StageProgress& progress = {});

// `model`, with its covariances, moved by the similarity that aligns its cameras and their axes
// with those of `world`, which has all of its frames.
MapperResult InWorldOf(const Reconstruction& world, MapperResult model);

// RefineModel into a folder: a model folder with clip.tracks. Whole or not at all. `source`,
// `mask`: what the sequence was opened from.
RefinedModel RefineModelIntoFolder(const std::filesystem::path& model,
                                   Sequence& sequence,
                                   const std::string& source,
                                   const std::string& mask,
                                   const RefineModelOptions& options,
                                   const std::filesystem::path& folder,
                                   const StageProgress& progress = {});

}  // namespace cohort
