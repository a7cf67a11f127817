#pragma once

#include "frontend/track/second_look.h"
#include "pipelines/console/command.h"

namespace cohort {

struct RefineCommandOptions {
  std::string tracks;
  std::string model;
  std::string images;
  std::string out;
  std::string json;
  double border_px = 5.0;
  double max_scale = 2.0;
  SecondLookOptions second_look;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Text("tracks", o.tracks, "the .tracks file that the model was made of");
    v.Text("model", o.model, "model folder of `cohort reconstruct`");
    v.Text("images", o.images, "the clip, where it is no longer where the tracks were made of it");
    v.Text("out", o.out, "the .tracks file to write");
    v.Text("json", o.json, "file for the figures of the run");
    v.Number("border_px", o.border_px, 0.0, 100.0, "not measured nearer to the image border [px]");
    v.Number("max_scale",
             o.max_scale,
             1.0,
             100.0,
             "not measured where the feature looks larger or smaller than its template by this");
    SecondLookOptions::Visit(o.second_look, v);
  }
};

struct RefineFigures {
  std::size_t before = 0;    // observations of the tracks that have a point
  std::size_t kept = 0;      // of them, measured again
  std::size_t regained = 0;  // observations where the first pass had none
};

// Tracks and their model -> tracks measured anew where the model's points are seen (SecondLook).
// Tracks without a point, and frames without a pose, keep what they had.
RefineFigures RefineTracks(const RefineCommandOptions& options);
void RunRefine(const RefineCommandOptions& options);

Command RefineCommand();

}  // namespace cohort
