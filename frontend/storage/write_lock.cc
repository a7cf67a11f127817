#include "frontend/storage/write_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>
#include <system_error>
#include <thread>
#include <utility>

#include "frontend/core/error.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

constexpr std::chrono::seconds kPatience{5};
constexpr std::chrono::milliseconds kPause{20};

// Whether no other run holds the lock. True if the file system has no locks.
bool TryLock(int descriptor, int kind) {
  return flock(descriptor, kind | LOCK_NB) == 0 || errno != EWOULDBLOCK;
}

// Whether the lock is a lock of bytes: NFS converts flock to a lock of all bytes of the file
// (flock(2)), and SQLite, which locks bytes of the files that we hold, would wait for us. SQLite
// never locks the first byte.
bool IsOfBytes(int descriptor) {
  struct flock first {};
  first.l_type = F_WRLCK;
  first.l_len = 1;
  return fcntl(descriptor, F_GETLK, &first) == 0 && first.l_type != F_UNLCK;
}

// Takes the lock, but releases it again if it is a lock of bytes.
bool TryLockBesideSqlite(int descriptor, int kind) {
  if (!TryLock(descriptor, kind)) return false;
  if (IsOfBytes(descriptor)) flock(descriptor, LOCK_UN);
  return true;
}

void LockOrThrow(int descriptor,
                 const fs::path& path,
                 int kind,
                 bool (*try_lock)(int, int) = TryLockBesideSqlite) {
  const auto until = std::chrono::steady_clock::now() + kPatience;
  while (!try_lock(descriptor, kind)) {
    if (std::chrono::steady_clock::now() > until) {
      ThrowError(
          "cannot write {}: another run is writing it; wait until it ends, or give another output",
          path.string());
    }
    std::this_thread::sleep_for(kPause);
  }
}

int Open(const fs::path& path) {
  return open(path.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
}

// Returns the errno of the failed call, or 0.
int Remove(const fs::path& path, bool folder) {
  if (folder) {
    std::error_code error;
    fs::remove_all(path, error);
    return error.value();
  }
  return unlink(path.c_str()) == 0 || errno == ENOENT ? 0 : errno;
}

// For a file that is only a lock, if necessary a lock of bytes. Opened for writing, because NFS
// locks no other file.
int OpenLockFile(const fs::path& path) {
  return open(path.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0644);
}

int Make(const fs::path& path, bool folder, int* descriptor) {
  if (folder) {
    if (mkdir(path.c_str(), 0777) != 0) return errno;
    *descriptor = Open(path);
  } else {
    *descriptor = open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC, 0666);
  }
  return *descriptor < 0 ? errno : 0;
}

}  // namespace

WriteLock WriteLock::OfNew(const fs::path& path, bool folder) {
  int error = EEXIST;
  for (int attempt = 0; error == EEXIST && attempt < 100; ++attempt) {
    // The old file is locked while it is removed, so that no other run's new file is removed.
    const WriteLock old(Open(path));
    const int why_not = old.descriptor_ < 0 ? errno : 0;
    // An entry that is not a file has no lock; a file without permission may be in use by another
    // user.
    if (why_not != 0 && why_not != ENOENT && why_not != ELOOP && why_not != ENXIO) {
      ThrowError("cannot write {}: the existing file cannot be opened: {}; remove it",
                 path.string(),
                 std::strerror(why_not));
    }
    if (old.descriptor_ >= 0) {
      LockOrThrow(old.descriptor_, path, LOCK_EX);
      if (!old.IsAt(path)) continue;
    }
    // If there was nothing, another run may have created its own by now.
    if (why_not != ENOENT) {
      error = Remove(path, folder);
      if (error != 0) break;
    }
    int descriptor = -1;
    error = Make(path, folder, &descriptor);
    WriteLock made(descriptor);
    if (error != 0) continue;
    LockOrThrow(descriptor, path, LOCK_EX);
    if (made.IsAt(path)) return made;
    error = EEXIST;
  }
  if (folder) ThrowError("cannot make folder {}: {}", path.string(), std::strerror(error));
  ThrowError("cannot write {}: {}",
             path.string(),
             error == EISDIR ? "a folder of that name exists, remove it" : std::strerror(error));
}

// Another run may have replaced the file while we waited.
bool WriteLock::IsAt(const fs::path& path) const {
  struct stat held {};
  struct stat there {};
  return fstat(descriptor_, &held) == 0 && lstat(path.c_str(), &there) == 0 &&
         held.st_dev == there.st_dev && held.st_ino == there.st_ino;
}

WriteLock WriteLock::OfNewFile(const fs::path& path) { return OfNew(path, false); }
WriteLock WriteLock::OfNewFolder(const fs::path& path) { return OfNew(path, true); }

WriteLock WriteLock::Of(const fs::path& path, bool shared) {
  WriteLock lock(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC));
  if (lock.descriptor_ < 0 && errno != ENOENT) {
    ThrowError("cannot write {}: {}", path.string(), std::strerror(errno));
  }
  if (lock.descriptor_ >= 0) LockOrThrow(lock.descriptor_, path, shared ? LOCK_SH : LOCK_EX);
  return lock;
}

std::optional<WriteLock> WriteLock::TryOf(const fs::path& path) {
  WriteLock lock(Open(path));
  if (lock.descriptor_ >= 0 && !TryLockBesideSqlite(lock.descriptor_, LOCK_EX)) return std::nullopt;
  return lock;
}

WriteLock WriteLock::OfLockFile(const fs::path& path) {
  WriteLock lock(OpenLockFile(path));
  if (lock.descriptor_ >= 0) LockOrThrow(lock.descriptor_, path, LOCK_EX, TryLock);
  return lock;
}

WriteLock WriteLock::Await(const fs::path& path) {
  WriteLock lock(OpenLockFile(path));
  int status = -1;
  if (lock.descriptor_ >= 0) {
    do {
      status = flock(lock.descriptor_, LOCK_EX);
    } while (status != 0 && errno == EINTR);
  }
  if (status != 0) ThrowError("cannot lock {}: {}", path.string(), std::strerror(errno));
  return lock;
}

WriteLock& WriteLock::operator=(WriteLock&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  return *this;
}

WriteLock::~WriteLock() {
  if (descriptor_ >= 0) close(descriptor_);
}

}  // namespace cohort
