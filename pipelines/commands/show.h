#pragma once

#include <string>
#include <vector>

#include "pipelines/console/command.h"

namespace cohort {

struct ShowOptions {
  std::vector<std::string> tracks;
  std::string out;
  std::string images;
  std::string model;
  double frames_per_second = 15.0;
  int width_px = 0;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.List("tracks",
           o.tracks,
           "The .tracks files of a clip: one, or two to see side by side.",
           Tier::kCommon);
    v.Text("out",
           o.out,
           "What to write: a video .mp4, a .gif (with the program ffmpeg), or a page .html.",
           Tier::kCommon);
    v.Text("images",
           o.images,
           "The clip, if it is not any more where the tracks were made of it.",
           Tier::kCommon);
    v.Text("model",
           o.model,
           "For a page: the model folder made of the tracks, shown in 3-D.",
           Tier::kCommon);
    v.Number("frames_per_second",
             o.frames_per_second,
             0.1,
             240.0,
             "How fast the video goes [1/s].",
             Tier::kCommon);
    v.Number("width_px",
             o.width_px,
             0,
             8192,
             "Width of each tracker's picture in the video [px]; 0: the clip's.",
             Tier::kCommon);
  }
};

// Tracks as a video (WriteTrackVideo), or with their model as a page (WriteClipReport).
void RunShow(const ShowOptions& options);
Command ShowCommand();

}  // namespace cohort
