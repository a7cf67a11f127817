#pragma once

#include <string>
#include <vector>

#include "pipelines/console/command.h"

namespace cohort {

// Manual pages (man(7), section 1) with the contents of --help and --help-all. The same program
// writes the same bytes: they contain its version and no date.

// cohort(1): purpose, commands, exit codes.
std::string ManualOfProgram(const std::vector<Command>& commands);

// cohort-track(1) and the like: all options.
std::string ManualOfCommand(const Command& command);

}  // namespace cohort
