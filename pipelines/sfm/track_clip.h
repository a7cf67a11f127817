#pragma once

#include <string>
#include <vector>

#include "frontend/track/tracker_options.h"
#include "pipelines/sfm/input.h"
#include "pipelines/sfm/progress.h"
#include "pipelines/sfm/second_pass.h"

namespace cohort {

// The options of `cohort track`.
struct TrackClipOptions {
  InputOptions input;
  std::string out;
  MaskOptions masks;
  int threads = 0;
  std::string json;
  TrackerOptions tracker;
  SecondPassOptions second_pass;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    InputOptions::Visit(o.input, v);
    v.Text("out", o.out, "The .tracks file to write.", Tier::kCommon);
    MaskOptions::Visit(o.masks, v);
    v.Number("threads",
             o.threads,
             0,
             1024,
             "The number of threads; 0: one per core. More threads are faster, and the tracks stay "
             "the same.",
             Tier::kCommon);
    v.Text("json", o.json, "Also write the figures of the run to this file.", Tier::kCommon);
    TrackerOptions::Visit(o.tracker, v);
    v.Group("second_pass", o.second_pass, "the second pass", Tier::kExpert);
  }
};

struct TrackFigures {
  std::size_t frames = 0;  // with repeats
  std::size_t repeats = 0;
  std::size_t tracks = 0;
  std::size_t observations = 0;
  std::size_t predicted = 0;
  double mean_observed_length = 0.0;
  std::vector<FrameIndex> cuts;
  double decode_ms = 0.0;  // of all frames, as the following
  double detect_ms = 0.0;
  double track_ms = 0.0;
  double write_ms = 0.0;
  double second_pass_ms = 0.0;

  double PerFrame(double ms) const { return frames == 0 ? 0.0 : ms / static_cast<double>(frames); }
};

// Makes .tracks from INPUT: tracks all frames, then runs the second pass, whose tracks replace the
// first's if a reconstruction with Ceres succeeds.
TrackFigures TrackClip(const TrackClipOptions& options, const JobReport& report = {});

// For a run that continues after an interruption: whether the file at options.out exists; its
// warning is repeated. Throws Error if it was made from another input or with other options.
bool HasTracksOf(const TrackClipOptions& options, const JobReport& report = {});
// The warning of tracks that are kept; empty if they have none.
std::string WarningOfKept(const TrackFile& tracks);

// WithSecondPass, with its outcome in the report.
TrackFile RunSecondPass(TrackFile file,
                        Sequence& sequence,
                        const SecondPassOptions& options,
                        const JobReport& report = {});

}  // namespace cohort
