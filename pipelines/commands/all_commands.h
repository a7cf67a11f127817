#pragma once

#include <vector>

#include "pipelines/console/command.h"

namespace cohort {

// The commands of the program, in the order in which `cohort --help` lists them.
std::vector<Command> AllCommands();

}  // namespace cohort
