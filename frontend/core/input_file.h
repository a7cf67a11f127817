#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "frontend/core/descriptor.h"
#include "frontend/core/error.h"

namespace cohort {

// What is read was written by others: nothing of it is waited for, and none of it fills the memory
// because it says so.

// The largest file that is read whole, unless the reader says less.
inline constexpr std::uint64_t kMaxWholeFileBytes = std::uint64_t{1} << 32;

// No file has this name. Asking first whether one has does not do where another program makes and
// removes it meanwhile.
class MissingFileError : public Error {
 public:
  using Error::Error;
};

// Throws Error naming the path unless it is a file that may be read, here and below MissingFileError
// where there is none. A pipe would be waited for, a device may have no end: neither is a file. What
// is read no output of the program takes the place of (InputRecord).
void CheckInputFile(const std::filesystem::path& path);

// The same, opened.
std::ifstream OpenInputFile(const std::filesystem::path& path);
Descriptor OpenInputDescriptor(const std::filesystem::path& path);

// All of a file. Throws Error naming the path if there is none, or it is larger than `max_bytes`,
// SystemError where the system does not give one that is there.
std::string ReadBytes(const std::filesystem::path& path,
                      std::uint64_t max_bytes = kMaxWholeFileBytes);

// Why a text cannot be the name of a picture; empty: it can. Names stand in tables and models, a
// line each, and other programs write pictures under them into their output folders: so they have
// no control characters, are not absolute and lead out of no folder.
std::string FaultOfPictureName(std::string_view name);
// Throws Error naming `source`, which has it, where it cannot.
void RequirePictureName(std::string_view source, std::string_view name);

}  // namespace cohort
