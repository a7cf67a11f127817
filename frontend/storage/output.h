#pragma once

#include <filesystem>
#include <functional>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "frontend/storage/input_file.h"
#include "frontend/storage/write_lock.h"

namespace cohort {

// PATH.partial, the name under which an output is written.
std::filesystem::path PartialOf(const std::filesystem::path& path);

// Outputs are written whole or not at all: into a new file or folder, PATH.partial, beside the
// final path, which is renamed at the end. The old output stays until Commit; without Commit (an
// exception) the partial one is removed. Two runs cannot write the same output at the same time.
// Throws Error naming the path.
//
//   OutputFile out("a.csv");
//   ... write out.partial() ...
//   out.Commit();
class OutputFile {
 public:
  // Throws at once if the folder is missing or not writable, if the path is a folder, a pipe, a
  // socket or a device, or if the run reads this very file (InputRecord; Commit checks again).
  explicit OutputFile(std::filesystem::path path);
  OutputFile(const OutputFile&) = delete;
  OutputFile& operator=(const OutputFile&) = delete;
  ~OutputFile();

  const std::filesystem::path& partial() const { return partial_; }  // PATH.partial
  // Call this after another program or a library has replaced partial() by a new file.
  void LockAnew();
  void Commit();

 private:
  std::filesystem::path path_;
  std::filesystem::path partial_;
  std::optional<WriteLock> lock_;
  bool committed_ = false;
};

// The same for a folder. An existing folder is replaced whole. To protect against mistakes, a
// folder that holds an entry whose name is not ours, or a file that the run reads, is rejected: at
// once, and in Commit if an entry was added meanwhile. The same holds for PATH.partial. If other
// programs use the same names, `was_ours` decides from the contents whether we wrote the folder.
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

// OutputFile's initial checks, for code that writes a file in another way.
void CheckOutputPath(const std::filesystem::path& path);
// The same for those paths that are given (not empty), before hours of work.
void CheckOutputsGiven(std::initializer_list<std::filesystem::path> paths);

// The same for code that replaces a folder in another way.
void CheckFolderHoldsNoInput(const std::filesystem::path& folder);

// Throws UsageError if two options name the same file; empty paths are ignored.
void CheckDistinctOutputs(
    std::initializer_list<std::pair<std::string_view, std::filesystem::path>> outputs);

// Writes bytes to a file in place; write to OutputFile's partial() for whole or not at all.
void WriteBytes(const std::filesystem::path& path, std::string_view bytes);

}  // namespace cohort
