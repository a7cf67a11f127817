#pragma once

#include "datasets/degrade/degrade.h"
#include "pipelines/sfm/input.h"

namespace cohort {

// The options of `cohort degrade`.
struct DegradeClipOptions {
  InputOptions input;
  std::string out;
  std::string level = "medium";
  DegradeOptions degrade;  // with the level above

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    InputOptions::Visit(o.input, v);
    v.Text("out", o.out, "The folder to write, in TUM RGB-D layout.", Tier::kCommon);
    v.Text("level",
           o.level,
           "The level of darkness: clean, medium, hard or a number; 0 is clean, 1 medium, 2 hard, "
           "and numbers beyond 2 are darker still.",
           Tier::kCommon);
    DegradeOptions::Visit(o.degrade, v);
  }
};

// Darkens INPUT and keeps its ground truth.
void DegradeClip(const DegradeClipOptions& options);

}  // namespace cohort
