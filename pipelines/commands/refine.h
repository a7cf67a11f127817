#pragma once

#include <string>

#include "pipelines/console/command.h"
#include "pipelines/sfm/refine_model.h"

namespace cohort {

// Two forms: tracks and the model made from them, or a model alone with its pictures.
struct RefineCommandOptions {
  std::string tracks;
  std::string model;
  std::string images;
  std::string out;
  std::string mask;
  std::string json;
  RefineModelOptions of_model;  // its second pass serves both forms

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Text("tracks",
           o.tracks,
           "The .tracks file that the model was made from; another program's model has none.",
           Tier::kCommon);
    v.Text("model",
           o.model,
           "The model folder of `cohort reconstruct`, or a COLMAP model of a video or of an "
           "ordered picture sequence.",
           Tier::kCommon);
    v.Text("images",
           o.images,
           "The pictures. For a COLMAP model: under the names that they have in the model. For "
           "tracks: only needed if the pictures are no longer where they were when the tracks were "
           "made.",
           Tier::kCommon);
    v.Text("out",
           o.out,
           "The .tracks file to write or, for a COLMAP model, the folder of the refined model.",
           Tier::kCommon);
    v.Text("mask",
           o.mask,
           "A mask of the frames' size, black where nothing is measured, or a folder with one for "
           "each frame, as for `cohort track`. The default is the mask of the tracks.",
           Tier::kCommon);
    v.Text("json", o.json, "Also write the figures of the run to this file.", Tier::kCommon);
    RefineModelOptions::Visit(o.of_model, v);
    SecondPassOptions::VisitMeasurement(o.of_model.second_pass, v);
  }
};

// Refines tracks by the model made from them (MeasureAgain), or a COLMAP model by measuring it
// again (RefineModel).
void RunRefine(const RefineCommandOptions& options);

Command RefineCommand();

}  // namespace cohort
