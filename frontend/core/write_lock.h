#pragma once

#include <filesystem>
#include <optional>

namespace cohort {

// Keeps other runs of the program away from a file or folder that this one writes, until it is
// destroyed or the process ends, however it ends. Where another run holds it, it is waited for some
// seconds (a run that was killed may still be ending); then Error says that there is one. File systems
// that know no locks have none, nor those whose locks would meet SQLite's (NFS).
class WriteLock {
 public:
  // An empty file in the place of what was there (no folder): made by us, never reached by a link that
  // somebody else has put there, as one may in /tmp. Throws Error naming the path.
  static WriteLock OfNewFile(const std::filesystem::path& path);
  // The same for a folder, in the place of a folder with all that it holds.
  static WriteLock OfNewFolder(const std::filesystem::path& path);
  // What is there; none where nothing is. `shared`: by several at a time, if all say so.
  static WriteLock Of(const std::filesystem::path& path, bool shared = false);
  // The same without waiting: none if another run holds it.
  static std::optional<WriteLock> TryOf(const std::filesystem::path& path);

  // An empty file that is there for this alone, made where it is missing and left behind; it is locked
  // on NFS, too.
  static WriteLock OfLockFile(const std::filesystem::path& path);
  // The same, waited for as long as another run holds it. Throws Error where there are no locks.
  static WriteLock Await(const std::filesystem::path& path);

  // Is what it holds still what lies at the path?
  bool IsAt(const std::filesystem::path& path) const;

  WriteLock(WriteLock&& other) noexcept : descriptor_(other.descriptor_) { other.descriptor_ = -1; }
  WriteLock& operator=(WriteLock&& other) noexcept;
  ~WriteLock();

 private:
  explicit WriteLock(int descriptor) : descriptor_(descriptor) {}
  static WriteLock OfNew(const std::filesystem::path& path, bool folder);

  int descriptor_ = -1;
};

}  // namespace cohort
