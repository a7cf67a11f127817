#pragma once

#include <filesystem>
#include <string>

namespace cohort {

// Sixteen hexadecimal digits that say whether something is still what it was (FNV-1a, 64 bits).

// Changes when a file of the clip does: names, sizes and times of writing.
std::string FingerprintOfClip(const std::string& input);

// Changes when the running program does: its bytes. The libraries that it loads are not in it.
const std::string& FingerprintOfProgram();

}  // namespace cohort
