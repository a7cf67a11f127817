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
           "The .tracks files of a clip: one, or two to show side by side.",
           Tier::kCommon);
    v.Text("out",
           o.out,
           "The file to write: a video .mp4, a .gif (needs the program ffmpeg) or a page .html.",
           Tier::kCommon);
    v.Text("images",
           o.images,
           "The clip, if it is no longer where it was when the tracks were made.",
           Tier::kCommon);
    v.Text("model",
           o.model,
           "The model folder made from the tracks, which a page shows in 3-D.",
           Tier::kCommon);
    v.Number("frames_per_second",
             o.frames_per_second,
             0.1,
             240.0,
             "The frame rate of the video [1/s].",
             Tier::kCommon);
    v.Number("width_px",
             o.width_px,
             0,
             8192,
             "The width of each tracker's picture in the video [px]; 0: that of the clip.",
             Tier::kCommon);
  }
};

// Tracks as a video (WriteTrackVideo), or with their model as a page (WriteClipReport).
void RunShow(const ShowOptions& options);
Command ShowCommand();

}  // namespace cohort
