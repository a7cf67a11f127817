#include "pipelines/sfm/fingerprint.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <string_view>
#include <vector>

#include "frontend/core/error.h"
#include "frontend/storage/input_file.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

class Fnv1a {
 public:
  Fnv1a& operator<<(std::string_view bytes) {
    for (const char c : bytes) {
      hash_ = (hash_ ^ static_cast<unsigned char>(c)) * 1099511628211ULL;
    }
    return *this;
  }
  std::string Digits() const { return fmt::format("{:016x}", hash_); }

 private:
  std::uint64_t hash_ = 14695981039346656037ULL;
};

// Adds a file's size and some of its bytes, spread over it; for a list of files, all bytes. Adds
// nothing for an unreadable file.
void AddFile(const fs::path& path, Fnv1a& hash) {
  constexpr std::uint64_t kBlocks = 8;
  constexpr std::uint64_t kBlockBytes = 1024;
  std::error_code error;
  const std::uint64_t size = fs::file_size(path, error);
  if (error) return;
  hash << fmt::format("{} {}\n", path.filename().string(), size);
  constexpr std::uint64_t kMostOfList = 1 << 24;
  if ((path.extension() == ".txt" || path.extension() == ".csv") && size <= kMostOfList) {
    std::ifstream list(path, std::ios::binary);
    hash << std::string(std::istreambuf_iterator<char>(list), {});
    return;
  }
  std::ifstream file(path, std::ios::binary);
  std::array<char, kBlockBytes> block{};
  for (std::uint64_t i = 0; i < kBlocks && file; ++i) {
    if (size > kBlocks * kBlockBytes) {
      file.seekg(static_cast<std::streamoff>(i * (size - kBlockBytes) / (kBlocks - 1)));
    }
    file.read(block.data(), kBlockBytes);
    hash << std::string_view(block.data(), static_cast<std::size_t>(file.gcount()));
  }
}

// The fingerprint of all bytes; empty if the file cannot be read.
std::string FingerprintOfFile(const fs::path& path) {
  Fnv1a hash;
  std::ifstream file(path, std::ios::binary);
  if (!file) return "";
  std::vector<char> block(std::size_t{1} << 20);
  while (file) {
    file.read(block.data(), static_cast<std::streamsize>(block.size()));
    hash << std::string_view(block.data(), static_cast<std::size_t>(file.gcount()));
  }
  return hash.Digits();
}

}  // namespace

std::string FingerprintOfFrames(const Sequence& sequence) {
  const std::vector<fs::path> files = sequence.Files();
  if (files.empty()) return "";
  Fnv1a hash;
  for (const fs::path& file : files) AddFile(file, hash);
  return hash.Digits();
}

std::string FingerprintOfClip(const Sequence& sequence,
                              const std::string& input,
                              const fs::path& outputs) {
  if (!fs::is_directory(input)) return FingerprintOfFrames(sequence);  // a glob has no ground truth
  Fnv1a hash;
  const fs::path folder = fs::absolute(input);
  std::set<fs::path> files;
  for (auto entry =
           fs::recursive_directory_iterator(folder, fs::directory_options::skip_permission_denied);
       entry != fs::recursive_directory_iterator();
       ++entry) {
    std::error_code none_there;
    if (fs::equivalent(entry->path(), outputs, none_there)) {
      entry.disable_recursion_pending();
    } else {
      files.insert(entry->path());
    }
  }
  for (const fs::path& file : files) {
    hash << file.lexically_relative(folder).string();
    AddFile(file, hash);
  }
  // Includes the frames of a linked folder, which was not searched because it may lead anywhere.
  hash << FingerprintOfFrames(sequence);
  return hash.Digits();
}

std::map<std::string, std::string> FingerprintsOfOutputs(const fs::path& folder,
                                                         const std::vector<std::string>& names) {
  std::map<std::string, std::string> fingerprints;
  const auto add = [&](const fs::path& file) {
    fingerprints[file.lexically_relative(folder).string()] = FingerprintOfFile(file);
  };
  for (const std::string& name : names) {
    if (!fs::is_directory(folder / name)) {
      add(folder / name);
      continue;
    }
    for (const auto& entry : fs::recursive_directory_iterator(folder / name)) {
      if (entry.is_regular_file()) add(entry.path());
    }
  }
  return fingerprints;
}

std::string FingerprintOfBytes(const fs::path& file) {
  CheckInputFile(file);
  std::string digits = FingerprintOfFile(file);
  if (digits.empty()) ThrowError("cannot read {}", file.string());
  return digits;
}

std::string FingerprintOfBytes(const std::vector<fs::path>& files) {
  Fnv1a hash;
  for (const fs::path& file : files) {
    hash << fmt::format("{} {}\n", file.filename().string(), FingerprintOfBytes(file));
  }
  return hash.Digits();
}

bool AreStillThere(const fs::path& folder, const std::map<std::string, std::string>& fingerprints) {
  return std::all_of(fingerprints.begin(), fingerprints.end(), [&folder](const auto& output) {
    return FingerprintOfFile(folder / output.first) == output.second;
  });
}

const std::string& FingerprintOfProgram() {
  static const std::string kFingerprint = (Fnv1a() << ReadBytes("/proc/self/exe")).Digits();
  return kFingerprint;
}

}  // namespace cohort
