#pragma once

#include <string>

#include "pipelines/console/command.h"
#include "pipelines/sfm/second_pass.h"

namespace cohort {

struct RefineCommandOptions {
  std::string tracks;
  std::string model;
  std::string images;
  std::string out;
  std::string json;
  SecondPassOptions second_pass;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Text("tracks", o.tracks, "The .tracks file that the model was made of.", Tier::kCommon);
    v.Text("model", o.model, "The model folder of `cohort reconstruct`.", Tier::kCommon);
    v.Text("images",
           o.images,
           "The clip, if it is no longer where the tracks were made of it.",
           Tier::kCommon);
    v.Text("out", o.out, "The .tracks file to write.", Tier::kCommon);
    v.Text("json", o.json, "Write the figures of the run to this file, too.", Tier::kCommon);
    SecondPassOptions::VisitMeasurement(o.second_pass, v);
  }
};

// Tracks and a model that was made of them -> tracks measured anew (MeasureAgain).
void RunRefine(const RefineCommandOptions& options);

Command RefineCommand();

}  // namespace cohort
