#pragma once

#include <opencv2/core/mat.hpp>

#include "frontend/track/tracker_options.h"
#include "pipelines/commands/input_options.h"
#include "pipelines/console/command.h"
#include "pipelines/sfm/second_pass.h"

namespace cohort {

enum class SecondPassMode { kAuto, kOn, kOff };
inline constexpr ChoiceNames<SecondPassMode, 3> kSecondPassModeNames{
    {{"auto", SecondPassMode::kAuto}, {"on", SecondPassMode::kOn}, {"off", SecondPassMode::kOff}}};

struct TrackCommandOptions {
  InputOptions input;
  std::string out;
  std::string mask;
  bool resume = false;
  unsigned seed = 0;
  int threads = 0;
  std::string json;
  TrackerOptions tracker;
  SecondPassMode second_pass = SecondPassMode::kAuto;
  SecondPassOptions second_look;

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
    v.Choice("second_pass",
             o.second_pass,
             kSecondPassModeNames,
             "after the last frame, reconstruct, and measure every feature again where the model "
             "says that it is; auto: for the tracker subspace, strong and measured");
    v.Group("second_look", o.second_look, "the second pass");
  }
};

// Of a file; empty without one. Throws Error naming the path.
cv::Mat ReadMask(const std::string& path);

// Is there to be a second pass?
bool WantsSecondPass(SecondPassMode mode, const TrackerOptions& tracker);

// INPUT -> .tracks, frame by frame: a kill loses nothing but the frame it is at. Then the second
// pass, whose tracks take the place of the first's, if a reconstruction with Ceres succeeds.
void RunTrack(const TrackCommandOptions& options);

Command TrackCommand();

}  // namespace cohort
