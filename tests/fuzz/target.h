#pragma once

// What the fuzz targets share. A target is one function of the bytes of a file; libFuzzer makes up
// the bytes. Anything but an Error of one line is a finding: a crash, another exception, what the
// sanitizers see, more than 2 GB, or 25 seconds.

#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "frontend/core/error.h"
#include "frontend/storage/output.h"
#include "frontend/tracks/track_store.h"

namespace cohort::fuzz {

// Of this process, in memory where there is such a folder.
inline const std::filesystem::path& Folder() {
  static const std::filesystem::path kFolder = [] {
    const bool memory = std::filesystem::is_directory("/dev/shm");
    std::string pattern = memory ? "/dev/shm/cohort-fuzz-XXXXXX" : "/tmp/cohort-fuzz-XXXXXX";
    if (mkdtemp(pattern.data()) == nullptr) std::abort();
    static std::string name = pattern;
    std::atexit([] {
      std::error_code ignored;
      std::filesystem::remove_all(name, ignored);
    });
    return std::filesystem::path(pattern);
  }();
  return kFolder;
}

inline std::filesystem::path File(const std::string& name, std::string_view bytes) {
  std::filesystem::path path = Folder() / name;
  WriteBytes(path, bytes);
  return path;
}

// Inputs of several files: a line of %% is between them. Always `count` parts; those that are not
// there are empty.
inline std::vector<std::string_view> Split(std::string_view bytes, std::size_t count) {
  constexpr std::string_view kBetween = "\n%%\n";
  std::vector<std::string_view> parts;
  while (parts.size() + 1 < count) {
    const std::size_t end = bytes.find(kBetween);
    parts.push_back(bytes.substr(0, end));
    bytes.remove_prefix(end == std::string_view::npos ? bytes.size() : end + kBetween.size());
  }
  parts.push_back(bytes);
  return parts;
}

// The frames of a clip that tracks are imported for: frame_000000.png to frame_000011.png.
inline const std::vector<FrameInfo>& Frames() {
  static const std::vector<FrameInfo> kFrames = [] {
    std::vector<FrameInfo> frames;
    for (std::uint32_t i = 0; i < 12; ++i) {
      frames.push_back({FrameIndex{i}, fmt::format("frame_{:06}.png", i), i * 40'000'000});
    }
    return frames;
  }();
  return kFrames;
}
inline constexpr int kWidthPx = 160;
inline constexpr int kHeightPx = 120;

void Run(std::string_view bytes);  // the target

// Calls `read`; an Error is what bad bytes should give.
template <typename Read>
void Try(Read&& read) {
  try {
    read();
  } catch (const Error& error) {
    const std::string_view what = error.what();
    if (what.empty() || what.find('\n') != std::string_view::npos) std::abort();
  }
}

}  // namespace cohort::fuzz

extern "C" inline int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
extern "C" __attribute__((used)) inline int LLVMFuzzerTestOneInput(const std::uint8_t* data,
                                                                   std::size_t size) {
  cohort::fuzz::Run({reinterpret_cast<const char*>(data), size});
  return 0;
}
