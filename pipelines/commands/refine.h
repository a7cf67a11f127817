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
    v.Text("tracks", o.tracks, "the .tracks file that the model was made of");
    v.Text("model", o.model, "model folder of `cohort reconstruct`");
    v.Text("images", o.images, "the clip, where it is no longer where the tracks were made of it");
    v.Text("out", o.out, "the .tracks file to write");
    v.Text("json", o.json, "file for the figures of the run");
    SecondPassOptions::Visit(o.second_pass, v);
  }
};

// Tracks and a model that was made of them -> tracks measured anew (MeasureAgain).
void RunRefine(const RefineCommandOptions& options);

Command RefineCommand();

}  // namespace cohort
