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
    v.Text("out", o.out, "the folder to write, in TUM RGB-D layout");
    v.Text("level", o.level, "clean, medium, hard or a number: 0 clean, 1 medium, 2 hard");
    DegradeOptions::Visit(o.degrade, v);
  }
};

// INPUT -> the same clip in the dark, with its truth.
void RunDegrade(const DegradeCommandOptions& options);

Command DegradeCommand();

}  // namespace cohort
