#include "frontend/storage/output.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <memory>
#include <system_error>
#include <utility>

#include "frontend/core/error.h"
#include "frontend/storage/input_record.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

// Without a trailing slash or dot.
fs::path NameOfFolder(fs::path path) {
  const fs::path last = path.filename();
  if (last == "." || last == "..") path = fs::weakly_canonical(fs::absolute(path));
  return path.has_filename() ? path : path.parent_path();
}

void CheckParent(const fs::path& path) {
  constexpr std::size_t kLongestName = 230;  // of 255 bytes, because temporary names append to it
  if (path.filename().native().size() > kLongestName) {
    ThrowError("cannot write {}: its name is longer than {} bytes; give a shorter one",
               path.string(),
               kLongestName);
  }
  const fs::path parent = fs::absolute(path).parent_path();
  if (!fs::is_directory(parent)) {
    ThrowError("cannot write {}: there is no folder {}", path.string(), parent.string());
  }
  if (access(parent.c_str(), W_OK) != 0) {
    ThrowError(
        "cannot write {}: folder {}: {}", path.string(), parent.string(), std::strerror(errno));
  }
  // In a sticky folder such as /tmp, files of another user cannot be replaced.
  struct stat of_parent {};
  struct stat old {};
  const uid_t user = geteuid();
  if (user != 0 && stat(parent.c_str(), &of_parent) == 0 && (of_parent.st_mode & S_ISVTX) != 0 &&
      of_parent.st_uid != user && lstat(path.c_str(), &old) == 0 && old.st_uid != user) {
    ThrowError("cannot replace {}: it is another user's; give another name", path.string());
  }
}

// In /dev and /proc, root at least could create files, or replace a device or the link to a stream.
bool IsOfTheSystem(const fs::path& path) {
  std::error_code error;
  const std::string folder = fs::canonical(fs::absolute(path).parent_path(), error).string() + "/";
  return folder.starts_with("/proc/") ||
         (folder.starts_with("/dev/") && !folder.starts_with("/dev/shm/"));
}

void CheckIsNoInput(const fs::path& path) {
  if (InputRecord::Holds(path)) {
    ThrowError("cannot write {}: this run reads that file; give another name", path.string());
  }
}

// The partial file must not be an input either, because it is removed.
void CheckPartialIsNoInput(const fs::path& path) {
  if (InputRecord::Holds(PartialOf(path))) {
    ThrowError(
        "cannot write {}: this run reads {}, the temporary name of that output; give another name",
        path.string(),
        PartialOf(path).string());
  }
}

// Whether another file system, or another folder, is mounted on the folder.
bool IsMountPoint(const fs::path& folder) {
  struct statx status {};
  return statx(AT_FDCWD, folder.c_str(), 0, STATX_TYPE, &status) == 0 &&
         (status.stx_attributes_mask & status.stx_attributes & STATX_ATTR_MOUNT_ROOT) != 0;
}

void Rename(const fs::path& from, const fs::path& to) {
  if (std::rename(from.c_str(), to.c_str()) != 0) {
    ThrowError("cannot write {}: {}", to.string(), std::strerror(errno));
  }
}

void RemoveQuietly(const fs::path& path) {
  std::error_code ignored;
  fs::remove_all(path, ignored);
}

struct CloseFile {
  void operator()(std::FILE* file) const { std::fclose(file); }
};

}  // namespace

fs::path PartialOf(const fs::path& path) { return path.string() + ".partial"; }

OutputFile::OutputFile(fs::path path) : path_(std::move(path)), partial_(PartialOf(path_)) {
  CheckOutputPath(path_);
  lock_ = WriteLock::OfNewFile(partial_);
}

OutputFile::~OutputFile() {
  std::error_code ignored;
  if (!committed_) fs::remove(partial_, ignored);
}

void OutputFile::LockAnew() {
  lock_ = WriteLock::TryOf(partial_);
  if (!lock_) {
    committed_ = true;  // it is not ours to remove
    ThrowError("cannot write {}: another run is writing it", path_.string());
  }
}

void OutputFile::Commit() {
  CheckIsNoInput(path_);  // again, for later changes
  if (!lock_->IsAt(partial_)) {
    committed_ = true;
    ThrowError("cannot write {}: {} has been replaced by something else in the meantime",
               path_.string(),
               partial_.string());
  }
  Rename(partial_, path_);
  committed_ = true;
}

OutputFolder::OutputFolder(fs::path path,
                           const std::vector<std::string>& own_names,
                           WasOurs was_ours)
    : OutputFolder(
          std::move(path),
          [own_names](const std::string& name) {
            return std::find(own_names.begin(), own_names.end(), name) != own_names.end();
          },
          std::move(was_ours)) {}

OutputFolder::OutputFolder(fs::path path,
                           std::function<bool(const std::string& name)> is_own,
                           WasOurs was_ours)
    : path_(NameOfFolder(std::move(path))),
      partial_(PartialOf(path_)),
      is_own_(std::move(is_own)),
      was_ours_(std::move(was_ours)) {
  std::error_code ignored;
  if (fs::is_directory(path_, ignored) && fs::equivalent(path_, ".", ignored)) {
    ThrowError("cannot replace folder {}: it is the current one; run it from another",
               path_.string());
  }
  CheckOld();
  CheckParent(path_);
  CheckPartial();
  lock_ = WriteLock::OfNewFolder(partial_);
}

OutputFolder::~OutputFolder() {
  if (!committed_) RemoveQuietly(partial_);
}

void OutputFolder::CheckOld() const {
  std::error_code ignored;
  if (!fs::exists(path_)) {
    if (fs::is_symlink(path_, ignored)) {
      ThrowError("cannot write folder {}: it is a dangling link; remove it", path_.string());
    }
    return;
  }
  if (!fs::is_directory(path_)) {
    ThrowError("cannot write folder {}: it is a file", path_.string());
  }
  for (const auto& entry : fs::directory_iterator(path_)) {
    const std::string name = entry.path().filename().string();
    if (!is_own_(name)) {
      ThrowError(
          "cannot replace folder {}: it holds {}, which cohort did not write; give another folder",
          path_.string(),
          name);
    }
  }
  if (was_ours_ && !fs::is_empty(path_) && !was_ours_(path_)) {
    ThrowError(
        "cannot replace folder {}: its contents were not written by cohort; give another folder",
        path_.string());
  }
  if (IsMountPoint(path_)) {
    ThrowError("cannot replace folder {}: something is mounted there; give a folder in it",
               path_.string());
  }
  CheckFolderHoldsNoInput(path_);
}

// The leftovers of a killed run have our names or our partial names.
void OutputFolder::CheckPartial() const {
  std::error_code error;
  if (fs::is_symlink(partial_, error)) return;  // the link itself is removed, not its target
  for (fs::directory_iterator entry(partial_, error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    if (!is_own_(name) && !is_own_(name.substr(0, name.find(".partial")))) {
      ThrowError(
          "cannot write folder {}: its temporary folder {} holds {}, which cohort did not write: "
          "move it",
          path_.string(),
          partial_.string(),
          name);
    }
  }
  CheckFolderHoldsNoInput(partial_);
}

void OutputFolder::Commit() {
  CheckOld();  // again, for later changes
  if (fs::exists(path_)) {
    // Swapped atomically, so that a complete folder exists at every moment; file systems that do
    // not support this get two renames.
    if (renameat2(AT_FDCWD, partial_.c_str(), AT_FDCWD, path_.c_str(), RENAME_EXCHANGE) == 0) {
      // The old folder, unless another run is about to remove it already.
      if (const auto old = WriteLock::TryOf(partial_)) RemoveQuietly(partial_);
    } else {
      std::string old = path_.string() + ".old-XXXXXX";
      if (mkdtemp(old.data()) == nullptr) {
        ThrowError("cannot write {}: {}", path_.string(), std::strerror(errno));
      }
      if (std::rename(path_.c_str(), (fs::path(old) / "old").c_str()) != 0) {
        const int error = errno;
        RemoveQuietly(old);
        ThrowError("cannot replace {}: {}", path_.string(), std::strerror(error));
      }
      try {
        Rename(partial_, path_);
      } catch (const Error& error) {
        const fs::path kept = fs::path(old) / "old";
        if (std::rename(kept.c_str(), path_.c_str()) != 0) {
          ThrowError("{}; the previous contents are in {}", error.what(), kept.string());
        }
        RemoveQuietly(old);
        throw;
      }
      RemoveQuietly(old);
    }
  } else {
    Rename(partial_, path_);
  }
  committed_ = true;
}

void CheckOutputPath(const fs::path& path) {
  if (path == "-") ThrowError("cannot write to the standard output: give the name of a file");
  if (fs::is_directory(path)) ThrowError("cannot write {}: it is a folder", path.string());
  if (IsOfTheSystem(path) || (fs::exists(path) && !fs::is_regular_file(path))) {
    ThrowError(
        "cannot write {}: it is not a file but a pipe, a socket or a device; give the name of a "
        "file",
        path.string());
  }
  CheckParent(path);
  CheckIsNoInput(path);
  CheckPartialIsNoInput(path);
}

void CheckOutputsGiven(std::initializer_list<fs::path> paths) {
  for (const fs::path& path : paths) {
    if (!path.empty()) CheckOutputPath(path);
  }
}

void CheckFolderHoldsNoInput(const fs::path& folder) {
  if (const auto file = InputRecord::FindBelow(folder)) {
    ThrowError("cannot replace folder {}: this run reads {}; give another folder",
               folder.string(),
               file->string());
  }
}

void CheckDistinctOutputs(
    std::initializer_list<std::pair<std::string_view, std::filesystem::path>> outputs) {
  std::map<std::string, std::string_view> options;
  for (const auto& [option, path] : outputs) {
    if (path.empty()) continue;
    const auto [other, is_new] = options.emplace(EntryOf(path), option);
    if (!is_new) {
      ThrowUsageError(
          "{} and {} are both {}: give each its own name", other->second, option, path.string());
    }
  }
}

void WriteBytes(const fs::path& path, std::string_view bytes) {
  std::unique_ptr<std::FILE, CloseFile> file(std::fopen(path.c_str(), "wb"));
  const bool written = file != nullptr &&
                       std::fwrite(bytes.data(), 1, bytes.size(), file.get()) == bytes.size() &&
                       std::fflush(file.get()) == 0;
  const bool closed = file != nullptr && std::fclose(file.release()) == 0;
  if (!written || !closed) ThrowError("cannot write {}: {}", path.string(), std::strerror(errno));
}

}  // namespace cohort
