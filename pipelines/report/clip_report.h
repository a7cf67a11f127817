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

// What the page of one clip shows beside its pictures.
struct ClipReport {
  std::string title;
  std::vector<std::pair<std::string, std::string>> facts;  // a word or two, and the value
  std::vector<std::string> sentences;                      // doubts, and what to film better
  Reconstruction model;                                    // empty: there is none
  // Covariances of positions [world^2]; may be empty.
  std::map<FrameIndex, Eigen::Matrix3d> camera_covariances;
  std::map<FeatureId, Eigen::Matrix3d> point_covariances;
};

// What a model folder says: facts, doubts, model and covariances. Throws Error where it is none.
ClipReport ReadClipReport(const std::filesystem::path& model_folder);

// One HTML page that opens offline: the words, the model in 3-D, the clip with its tracks and a
// slider, and how many features it held. `sequence`: the clip, rewound here. So that a page stays
// small, at most 150 frames of it are shown, 300 tracks (and of every frame 60) and 20000 points, and
// it says so. Whole or not at all.
void WriteClipReport(const std::filesystem::path& path,
                     const ClipReport& report,
                     const TrackFile& file,
                     Sequence& sequence,
                     const StageProgress& progress = {});

}  // namespace cohort
