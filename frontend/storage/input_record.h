#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace cohort {

// The resolved parent folder of a path with its name there; a link is not followed. Two paths with
// the same entry replace each other.
std::string EntryOf(const std::filesystem::path& path);

// Records which files a run has read, so that no output replaces one by mistake, as in `track v.mp4
// --out v.mp4`. Active while an instance lives, as in the program. Users of the libraries may read
// a file and rewrite it.
class InputRecord {
 public:
  InputRecord();
  InputRecord(const InputRecord&) = delete;
  InputRecord& operator=(const InputRecord&) = delete;
  ~InputRecord();

  static void Add(const std::filesystem::path& file);
  // The user permits replacing this file.
  static void Forget(const std::filesystem::path& file);
  // Whether renaming a file to this path would replace a file that was read.
  static bool Holds(const std::filesystem::path& path);
  // A file that was read in this folder or below, or the folder itself if it was added.
  static std::optional<std::filesystem::path> FindBelow(const std::filesystem::path& folder);
};

// While an instance lives, reading this file does not record it as an input: it is the run's own
// file, which may be replaced. A file recorded before stays recorded.
class OwnFile {
 public:
  explicit OwnFile(const std::filesystem::path& file);
  OwnFile(const OwnFile&) = delete;
  OwnFile& operator=(const OwnFile&) = delete;
  ~OwnFile();

 private:
  std::string entry_;
};

}  // namespace cohort
