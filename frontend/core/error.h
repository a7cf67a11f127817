#pragma once

#include <fmt/format.h>

#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

namespace cohort {

// The text with spaces for every control character, including those of UTF-8 (C1, line and
// paragraph separators). Names and values from files may contain line breaks and terminal control
// codes.
inline std::string OneLine(std::string_view text) {
  std::string line(text);
  const auto byte = [&line](std::size_t i) {
    return i < line.size() ? static_cast<unsigned char>(line[i]) : 0U;
  };
  for (std::size_t i = 0; i < line.size(); ++i) {
    std::size_t bytes = byte(i) < 0x20 || byte(i) == 0x7f ? 1 : 0;
    if (byte(i) == 0xc2 && byte(i + 1) >= 0x80 && byte(i + 1) < 0xa0) bytes = 2;
    if (byte(i) == 0xe2 && byte(i + 1) == 0x80 && (byte(i + 2) == 0xa8 || byte(i + 2) == 0xa9)) {
      bytes = 3;
    }
    line.replace(i, bytes, bytes, ' ');
  }
  return line;
}

// Invalid input or a failing resource: what() is one line that states what, where and what to do.
// The commands print it as `cohort: error: ...` and exit 1.
class Error : public std::runtime_error {
 public:
  explicit Error(std::string_view what) : std::runtime_error(Shown(what)) {}

 private:
  // A message may quote text of any length from a file.
  static std::string Shown(std::string_view what) {
    constexpr std::size_t kMostBytes = 8192;
    return OneLine(what.substr(0, kMostBytes)) + (what.size() > kMostBytes ? " ..." : "");
  }
};

// The system does not give access to an existing file: no permission, a bad disk, no free
// descriptors. Its contents are not in question.
class SystemError : public Error {
 public:
  using Error::Error;
};

// An invalid flag, option name or value: exit 2.
class UsageError : public Error {
 public:
  using Error::Error;
};

template <typename... Args>
[[noreturn]] void ThrowError(fmt::format_string<Args...> text, Args&&... args) {
  throw Error(fmt::format(text, std::forward<Args>(args)...));
}

template <typename... Args>
[[noreturn]] void ThrowUsageError(fmt::format_string<Args...> text, Args&&... args) {
  throw UsageError(fmt::format(text, std::forward<Args>(args)...));
}

// Checks an invariant of our own code, in release builds too.
inline void Check(bool holds, const char* what) {
  if (!holds) throw std::logic_error(std::string("broken invariant: ") + what);
}

}  // namespace cohort
