#pragma once

#include "pipelines/console/command.h"
#include "pipelines/sfm/input.h"

namespace cohort {

struct ImportCommandOptions {
  std::string tracks;
  InputOptions input;
  std::string out;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Text("tracks",
           o.tracks,
           "The CSV file of the tracks, with columns "
           "track_id,frame,x,y[,observed][,residual].",
           Tier::kCommon);
    InputOptions::Visit(o.input, v);
    v.Text("out", o.out, "The .tracks file to write.", Tier::kCommon);
  }
};

// Tracks of any other tracker -> .tracks.
void RunImport(const ImportCommandOptions& options);

Command ImportCommand();

}  // namespace cohort
