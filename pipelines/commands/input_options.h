#pragma once

#include <memory>
#include <optional>
#include <string>

#include "datasets/readers/sequence.h"
#include "frontend/core/options.h"

namespace cohort {

// Which frames a command reads.
struct InputOptions {
  std::string input;
  Layout layout = Layout::kAuto;
  std::string frames;
  std::string camera;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Text("input",
           o.input,
           "video file, folder or glob of images, or folder in TUM RGB-D, EuRoC or KITTI layout");
    v.Choice("layout", o.layout, kLayoutNames, "how to read the input");
    v.Text("frames", o.frames, "A:B or A:B:STEP, frames A to B - 1 of the input; all without");
    v.Text("camera",
           o.camera,
           "fx,fy,cx,cy[,k1,k2,p1,p2] [px], OpenCV's model, the centre of the top-left pixel is "
           "(0, 0); without: as the input says, else unknown");
  }
};

std::unique_ptr<Sequence> OpenInput(const InputOptions& options);

// The camera given, else the sequence's own, else none. Throws UsageError on another text.
std::optional<Camera> CameraOf(const InputOptions& options,
                               const Sequence& sequence,
                               int width_px,
                               int height_px);

}  // namespace cohort
