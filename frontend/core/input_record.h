#pragma once

#include <filesystem>
#include <optional>
#include <string>

namespace cohort {

// What a path is an entry of, whole, and its name there: where that is a link, not what it leads to.
// Two of the same replace each other.
std::string EntryOf(const std::filesystem::path& path);

// Which files a run has read, so that none of its outputs takes the place of one: a slip of the hand
// (`track v.mp4 --out v.mp4`) loses nothing. On while one lives, as in the program; whoever uses the
// libraries may well read a file and write it anew.
class InputRecord {
 public:
  InputRecord();
  InputRecord(const InputRecord&) = delete;
  InputRecord& operator=(const InputRecord&) = delete;
  ~InputRecord();

  static void Add(const std::filesystem::path& file);
  // The user says that this file may be replaced.
  static void Forget(const std::filesystem::path& file);
  // Whether what is renamed to the path would take the place of a file that was read.
  static bool Holds(const std::filesystem::path& path);
  // A file that was read in this folder, or below; the folder, where it is itself added.
  static std::optional<std::filesystem::path> FindBelow(const std::filesystem::path& folder);
};

// While one lives, to read this file does not make it an input: it is the run's own, which it may
// replace. What was an input before stays one.
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
