#include "frontend/storage/input_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "frontend/core/error.h"
#include "frontend/storage/input_record.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

[[noreturn]] void ThrowUnreadable(const fs::path& path, int error) {
  const std::string what = fmt::format("cannot read {}: {}", path.string(), std::strerror(error));
  if (error == ENOENT || error == ENOTDIR || error == ELOOP) throw MissingFileError(what);
  throw SystemError(what);
}

// Throws unless `status` is that of a file.
void CheckIsFile(const fs::path& path, const struct stat& status) {
  if (S_ISREG(status.st_mode)) return;
  ThrowError("cannot read {}: it is {}, not a file",
             path.string(),
             S_ISDIR(status.st_mode) ? "a folder" : "a pipe, a socket or a device");
}

[[noreturn]] void ThrowTooLarge(const fs::path& path, std::uint64_t max_bytes) {
  ThrowError("cannot read {}: it is larger than the {} bytes that such files may have",
             path.string(),
             max_bytes);
}

}  // namespace

void CheckInputFile(const fs::path& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0 || access(path.c_str(), R_OK) != 0) {
    ThrowUnreadable(path, errno);
  }
  CheckIsFile(path, status);
  InputRecord::Add(path);
}

std::ifstream OpenInputFile(const fs::path& path) {
  CheckInputFile(path);
  std::ifstream stream(path, std::ios::binary);
  if (!stream) ThrowUnreadable(path, errno);
  return stream;
}

Descriptor OpenInputDescriptor(const fs::path& path) {
  // O_NONBLOCK, because opening a pipe would wait for a writer.
  const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | O_NOCTTY);
  if (fd < 0) ThrowUnreadable(path, errno);
  struct stat status {};
  if (fstat(fd, &status) != 0 || !S_ISREG(status.st_mode)) {
    close(fd);
    CheckIsFile(path, status);
  }
  InputRecord::Add(path);
  return Descriptor(fd);
}

std::string ReadBytes(const fs::path& path, std::uint64_t max_bytes) {
  const Descriptor file = OpenInputDescriptor(path);
  struct stat status {};
  fstat(file.get(), &status);
  const auto size = static_cast<std::uint64_t>(status.st_size);
  if (size > max_bytes) ThrowTooLarge(path, max_bytes);
  std::string bytes;
  bytes.reserve(size);
  // Up to the end rather than to the size, because files in /proc state a size of 0.
  char buffer[1 << 16];
  while (true) {
    const ssize_t n = read(file.get(), buffer, sizeof(buffer));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) ThrowUnreadable(path, errno);
    if (n == 0) return bytes;
    if (bytes.size() + static_cast<std::uint64_t>(n) > max_bytes) ThrowTooLarge(path, max_bytes);
    bytes.append(buffer, static_cast<std::size_t>(n));
  }
}

std::string FaultOfPictureName(std::string_view name) {
  if (name.empty()) return "is empty";
  if (OneLine(name) != name) return "has a line break or another control character";
  const fs::path path(name);
  if (path.is_absolute()) return "is an absolute path, not one below the folder of the pictures";
  if (std::ranges::find(path, "..") != path.end()) return "leads out of the folder of the pictures";
  return {};
}

void RequirePictureName(std::string_view source, std::string_view name) {
  if (const std::string fault = FaultOfPictureName(name); !fault.empty()) {
    ThrowError("{}: the name of picture '{}' {}: rename it", source, name, fault);
  }
}

}  // namespace cohort
