#pragma once

#include "frontend/track/tracker_options.h"
#include "pipelines/commands/input_options.h"
#include "pipelines/console/command.h"

namespace cohort {

struct TrackCommandOptions {
  InputOptions input;
  std::string out;
  std::string mask;
  bool resume = false;
  unsigned seed = 0;
  int threads = 0;
  std::string json;
  TrackerOptions tracker;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    InputOptions::Visit(o.input, v);
    v.Text("out", o.out, "the .tracks file to write");
    v.Text("mask", o.mask, "picture of the frames' size, black where no feature may be");
    v.Flag("resume", o.resume, "go on where an interrupted run with the same options ended");
    v.Number("seed", o.seed, 0U, 4294967295U, "of random draws; kept in the file's options");
    v.Number("threads", o.threads, 0, 1024, "at most; 0: one a core; results do not depend on it");
    v.Text("json", o.json, "file for the figures of the run");
    TrackerOptions::Visit(o.tracker, v);
  }
};

// INPUT -> .tracks, frame by frame: a kill loses nothing but the frame it is at.
void RunTrack(const TrackCommandOptions& options);

Command TrackCommand();

}  // namespace cohort
