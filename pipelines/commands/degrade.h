#pragma once

#include "datasets/degrade/degrade.h"
#include "pipelines/commands/input_options.h"
#include "pipelines/console/command.h"

namespace cohort {

struct DegradeCommandOptions {
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
           "How dark it gets: clean, medium, hard or a number; 0 is clean, 1 medium, 2 "
           "hard, and beyond 2 it gets darker still.",
           Tier::kCommon);
    DegradeOptions::Visit(o.degrade, v);
  }
};

// INPUT -> the same clip in the dark, with its truth.
void RunDegrade(const DegradeCommandOptions& options);

Command DegradeCommand();

}  // namespace cohort
