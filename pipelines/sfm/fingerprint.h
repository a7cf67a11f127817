#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "datasets/readers/sequence.h"

namespace cohort {

// Sixteen hexadecimal digits that detect changes (FNV-1a, 64 bits). They cover the name of each
// file, its size and 8 KiB spread over it, which is fast even for an hour of video and equal for a
// copy. Two clips of equal size differ nearly everywhere, but a file with a few changed bytes may
// go unnoticed.

// Changes with the files that the clip's frames are read from; empty if there are none.
std::string FingerprintOfFrames(const Sequence& sequence);

// Changes with any file of `input`, to which `sequence` belongs, be it of the frames or of the
// ground truth: a file, the pictures of a glob, or everything in the folder except the folder
// `outputs` in it. Linked folders in it contribute only the frames.
std::string FingerprintOfClip(const Sequence& sequence,
                              const std::string& input,
                              const std::filesystem::path& outputs);

// Covers all bytes. Throws Error naming a file that cannot be read.
std::string FingerprintOfBytes(const std::filesystem::path& file);
// The same of several files, with their names.
std::string FingerprintOfBytes(const std::vector<std::filesystem::path>& files);

// The fingerprints of a run's outputs, of all bytes, by their names in `folder`: `names` are files,
// or folders whose files all count.
std::map<std::string, std::string> FingerprintsOfOutputs(const std::filesystem::path& folder,
                                                         const std::vector<std::string>& names);
// Whether all are there unchanged. Other files may have been added.
bool AreStillThere(const std::filesystem::path& folder,
                   const std::map<std::string, std::string>& fingerprints);

// Changes with the bytes of the running program; the libraries that it loads do not count.
const std::string& FingerprintOfProgram();

}  // namespace cohort
