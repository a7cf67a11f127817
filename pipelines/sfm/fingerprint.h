#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "datasets/readers/sequence.h"

namespace cohort {

// Sixteen hexadecimal digits that say whether something is still what it was (FNV-1a, 64 bits). Of
// each file count its name, its size and 8 KiB spread over it: cheap, also for an hour of video,
// and the same for a copy. Two clips of equal size differ nearly everywhere; a file of which a few
// bytes were changed may be taken for the old one.

// Changes when the files do that the clip's frames are read from; empty where there are none.
std::string FingerprintOfFrames(const Sequence& sequence);

// Changes when a file of `input` does, of which `sequence` is, be it of the frames or of the truth:
// a file, the pictures of a glob, or all that the folder holds but the folder `outputs`, should it
// lie there. Of folders in it that are links only the frames count.
std::string FingerprintOfClip(const Sequence& sequence,
                              const std::string& input,
                              const std::filesystem::path& outputs);

// Of all bytes. Throws Error naming a file that cannot be read.
std::string FingerprintOfBytes(const std::filesystem::path& file);

// The fingerprints of what a run wrote, of all bytes, by their names in `folder`: `names` are files,
// or folders of which all files count.
std::map<std::string, std::string> FingerprintsOfOutputs(const std::filesystem::path& folder,
                                                         const std::vector<std::string>& names);
// Whether they are all there as they were. Others may have come since.
bool AreStillThere(const std::filesystem::path& folder,
                   const std::map<std::string, std::string>& fingerprints);

// Changes when the running program does: its bytes. The libraries that it loads are not in it.
const std::string& FingerprintOfProgram();

}  // namespace cohort
