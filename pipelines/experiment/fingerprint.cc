#include "pipelines/experiment/fingerprint.h"

#include <fmt/format.h>

#include <cstdint>
#include <set>
#include <string_view>

#include "frontend/core/output.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

std::string Fnv1a(std::string_view bytes) {
  std::uint64_t hash = 14695981039346656037ULL;
  for (const char c : bytes) {
    hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
  }
  return fmt::format("{:016x}", hash);
}

}  // namespace

std::string FingerprintOfClip(const std::string& input) {
  std::set<std::string> files;
  const auto add = [&files](const fs::path& path) {
    std::error_code error;
    const auto size = fs::file_size(path, error);
    if (error) return;
    const auto written = fs::last_write_time(path, error).time_since_epoch().count();
    files.insert(fmt::format("{} {} {}\n", path.filename().string(), size, written));
  };
  if (fs::is_regular_file(input)) {
    add(input);
  } else {
    fs::path folder = fs::absolute(input);  // of a glob that which holds it
    while (!fs::is_directory(folder)) folder = folder.parent_path();
    for (const auto& entry : fs::recursive_directory_iterator(folder)) add(entry.path());
  }
  std::string lines;
  for (const std::string& file : files) lines += file;
  return Fnv1a(lines);
}

const std::string& FingerprintOfProgram() {
  static const std::string kFingerprint = Fnv1a(ReadBytes("/proc/self/exe"));
  return kFingerprint;
}

}  // namespace cohort
