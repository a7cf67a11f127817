#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

#include "frontend/core/descriptor.h"
#include "frontend/core/error.h"

namespace cohort {

// Input files come from others: reading never blocks on one, and no size that one states is
// allocated unchecked.

// The size limit of a file that is read whole, unless the reader sets a lower one.
inline constexpr std::uint64_t kMaxWholeFileBytes = std::uint64_t{1} << 32;

// No file has this name. Checking for the file first is a race if another program creates and
// removes it meanwhile.
class MissingFileError : public Error {
 public:
  using Error::Error;
};

// Throws Error naming the path unless it is a readable file; here and below MissingFileError if
// there is none. A pipe or a device is not a file: a pipe may block, and a device may have no end.
// No output of the program replaces a file that was read (InputRecord).
void CheckInputFile(const std::filesystem::path& path);

// The same, and opens it.
std::ifstream OpenInputFile(const std::filesystem::path& path);
Descriptor OpenInputDescriptor(const std::filesystem::path& path);

// The contents of a file. Throws Error naming the path if there is none or it is larger than
// `max_bytes`, SystemError if the system does not give access to it.
std::string ReadBytes(const std::filesystem::path& path,
                      std::uint64_t max_bytes = kMaxWholeFileBytes);

// Why a text cannot be the name of a picture; empty if it can. Names occur in tables and models,
// one per line, and other programs write pictures under them into their output folders. They must
// therefore have no control characters, be relative and not lead out of the folder.
std::string FaultOfPictureName(std::string_view name);
// Throws Error naming `source`, which contains the name, if it cannot.
void RequirePictureName(std::string_view source, std::string_view name);

}  // namespace cohort
