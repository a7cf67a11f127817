#pragma once

#include <string>

#include "datasets/readers/sequence.h"

namespace cohort {

// Sixteen hexadecimal digits that say whether something is still what it was (FNV-1a, 64 bits). Of
// each file count its name, its size and 8 KiB spread over it: cheap, also for an hour of video, and
// the same for a copy. Two clips of equal size differ nearly everywhere; a file of which a few bytes
// were changed may be taken for the old one.

// Changes when the files do that the clip's frames are read from; empty where there are none.
std::string FingerprintOfFrames(const Sequence& sequence);

// Changes when a file of the input does, be it of the frames or of the truth: a file, or all that
// the folder holds.
std::string FingerprintOfClip(const std::string& input);

// Changes when the running program does: its bytes. The libraries that it loads are not in it.
const std::string& FingerprintOfProgram();

}  // namespace cohort
