#pragma once

#include <string>
#include <vector>

#include "pipelines/console/command.h"

namespace cohort {

// Scripts that complete a line of the program in a shell: commands, options, the values of those
// that choose, file names. After -- alone they offer the options that people use, after another
// letter all. The same program writes the same bytes.
std::string BashCompletion(const std::vector<Command>& commands);
std::string ZshCompletion(const std::vector<Command>& commands);
std::string FishCompletion(const std::vector<Command>& commands);

}  // namespace cohort
