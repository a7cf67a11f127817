#pragma once

#include <Eigen/Core>
#include <filesystem>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "backend/scene/reconstruction.h"
#include "datasets/readers/sequence.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/sfm/progress.h"

namespace cohort {

// The contents of a clip's page besides its pictures.
struct ClipReport {
  std::string title;
  std::vector<std::pair<std::string, std::string>> facts;  // a word or two, and the value
  std::vector<std::string> sentences;                      // doubts, and advice for filming
  Reconstruction model;                                    // empty if there is none
  // Covariances of positions [world^2]; may be empty.
  std::map<FrameIndex, Eigen::Matrix3d> camera_covariances;
  std::map<FeatureId, Eigen::Matrix3d> point_covariances;
};

// Reads a model folder: facts, doubts, model and covariances. Throws Error if it is not one.
ClipReport ReadClipReport(const std::filesystem::path& model_folder);

// One HTML page that opens offline: the text, the model in 3-D, the clip with its tracks and a
// slider, and the number of features. `sequence`: the clip, rewound here. To keep the page small,
// it shows at most 150 frames, 300 tracks (60 per frame) and 20000 points, and states so. Whole or
// not at all.
void WriteClipReport(const std::filesystem::path& path,
                     const ClipReport& report,
                     const TrackFile& file,
                     Sequence& sequence,
                     const StageProgress& progress = {});

}  // namespace cohort
