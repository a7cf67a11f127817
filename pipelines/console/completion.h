#pragma once

#include <string>
#include <vector>

#include "pipelines/console/command.h"

namespace cohort {

// Scripts for shell completion: commands, options, the values of choices, file names. After --
// alone they offer the common options, after another letter all. The same program writes the same
// bytes.
std::string BashCompletion(const std::vector<Command>& commands);
std::string ZshCompletion(const std::vector<Command>& commands);
std::string FishCompletion(const std::vector<Command>& commands);

}  // namespace cohort
