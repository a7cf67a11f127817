#pragma once

#include <filesystem>
#include <functional>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "frontend/core/input_file.h"
#include "frontend/core/write_lock.h"

namespace cohort {

// PATH.partial, as which an output is written.
std::filesystem::path PartialOf(const std::filesystem::path& path);

// Outputs are written whole or not at all: into a new file or folder, PATH.partial, beside the final
// path, renamed at the end. Until Commit the old one stays; without Commit (an exception) the partial one
// is removed. No other run can write the same one at the same time. Throws Error naming the path.
//
//   OutputFile out("a.csv");
//   ... write out.partial() ...
//   out.Commit();
class OutputFile {
 public:
  // Throws at once where the folder is missing or not writable, the path is a folder, a pipe, a socket
  // or a device, or the run reads this very file (InputRecord; Commit looks again).
  explicit OutputFile(std::filesystem::path path);
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  ~OutputFile();

  const std::filesystem::path& partial() const { return partial_; }  // PATH.partial
  // Where another program, or a library, has put a new file in the place of partial().
  void LockAnew();
  void Commit();

 private:
  std::filesystem::path path_;
  std::filesystem::path partial_;
  std::optional<WriteLock> lock_;
  bool committed_ = false;
};

// The same for a folder. An existing folder is replaced whole; so that a slip of the hand deletes
// nothing, one that holds an entry whose name is not ours, or a file that the run reads, is refused: at
// once, and in Commit where one was put there meanwhile. So is PATH.partial. Where others give the same
// names, `was_ours` tells from what is in a folder whether we have written it.
class OutputFolder {
 public:
  using WasOurs = std::function<bool(const std::filesystem::path& folder)>;
  OutputFolder(std::filesystem::path path,
               const std::vector<std::string>& own_names,
               WasOurs was_ours = {});
  OutputFolder(std::filesystem::path path,
               std::function<bool(const std::string& name)> is_own,
               WasOurs was_ours = {});
  OutputFolder(const OutputFolder&) = delete;
  OutputFolder& operator=(const OutputFolder&) = delete;
  ~OutputFolder();

  const std::filesystem::path& partial() const { return partial_; }
  void Commit();

 private:
  void CheckOld() const;  // what is to be replaced
  void CheckPartial() const;

  std::filesystem::path path_;
  std::filesystem::path partial_;
  std::function<bool(const std::string& name)> is_own_;
  WasOurs was_ours_;
  std::optional<WriteLock> lock_;
  bool committed_ = false;
};

// What OutputFile checks at once, for those who write a file in another way.
void CheckOutputPath(const std::filesystem::path& path);
// The same of those that are given, of the optional ones: before hours of work.
void CheckOutputsGiven(std::initializer_list<std::filesystem::path> paths);

// The same for those who replace a folder in another way.
void CheckFolderHoldsNoInput(const std::filesystem::path& folder);

// Throws UsageError where two options name the same file; empty ones are not given.
void CheckDistinctOutputs(
    std::initializer_list<std::pair<std::string_view, std::filesystem::path>> outputs);

// Writes bytes to a file in place; for whole or not at all write OutputFile's partial().
void WriteBytes(const std::filesystem::path& path, std::string_view bytes);

}  // namespace cohort
