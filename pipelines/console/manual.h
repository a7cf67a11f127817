#pragma once

#include <string>
#include <vector>

#include "pipelines/console/command.h"

namespace cohort {

// Manual pages (man(7), section 1) of what --help and --help-all show. The same program writes the
// same bytes: they carry its version and no date.

// cohort(1): what it is, its commands, how it ends.
std::string ManualOfProgram(const std::vector<Command>& commands);

// cohort-track(1) and the like: all options.
std::string ManualOfCommand(const Command& command);

}  // namespace cohort
