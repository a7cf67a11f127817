#pragma once

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>

#include "frontend/core/error.h"

namespace cohort {

// One process at a time: waits until no other holds the lock of this file, and holds it for its own
// lifetime. The file stays, empty; a process that dies lets go.
class FileLock {
 public:
  explicit FileLock(const std::filesystem::path& path)
      : descriptor_(open(path.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_CLOEXEC, 0644)) {
    int status = -1;
    if (descriptor_ >= 0) {
      do {
        status = flock(descriptor_, LOCK_EX);
      } while (status != 0 && errno == EINTR);
    }
    if (status != 0) ThrowError("cannot lock {}: {}", path.string(), std::strerror(errno));
  }
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;
  ~FileLock() { close(descriptor_); }

 private:
  int descriptor_;
};

}  // namespace cohort
