#pragma once

#include <filesystem>
#include <optional>

namespace cohort {

// Keeps other runs of the program away from a file or folder that this one writes, until the lock
// is destroyed or the process ends in any way. If another run holds the lock, this one waits for
// some seconds (a killed run may still be ending), then throws Error. File systems without locks,
// or whose locks would conflict with SQLite's (NFS), are not locked.
class WriteLock {
 public:
  // Replaces what was there (no folder) by an empty file that we create. It never follows a link
  // that another user has put there, as in /tmp. Throws Error naming the path.
  static WriteLock OfNewFile(const std::filesystem::path& path);
  // The same for a folder, which replaces a folder with all that it holds.
  static WriteLock OfNewFolder(const std::filesystem::path& path);
  // Locks what is there; holds nothing if nothing is. `shared` locks may coexist.
  static WriteLock Of(const std::filesystem::path& path, bool shared = false);
  // The same without waiting: returns nullopt if another run holds it.
  static std::optional<WriteLock> TryOf(const std::filesystem::path& path);

  // Locks an empty file that serves only this purpose. It is created if missing and left behind; it
  // is locked on NFS, too.
  static WriteLock OfLockFile(const std::filesystem::path& path);
  // The same, but waits as long as another run holds it. Throws Error if there are no locks.
  static WriteLock Await(const std::filesystem::path& path);

  // Whether the path still names the locked file.
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
