#pragma once

#include <fmt/format.h>

#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

namespace cohort {

// The text with a space for every control character: names and values out of files may hold line
// breaks, and codes that a terminal would obey.
inline std::string OneLine(std::string_view text) {
  std::string line(text);
  for (char& c : line) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = ' ';
  }
  return line;
}

// Bad input or a resource that fails: what() is one line naming what, where and what to do.
// The commands print it as `cohort: error: ...` and exit 1.
class Error : public std::runtime_error {
 public:
  explicit Error(std::string_view what) : std::runtime_error(OneLine(what)) {}
};

// A wrong flag, option name or value: exit 2.
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

// An invariant of our own code: checked in release builds too.
inline void Check(bool holds, const char* what) {
  if (!holds) throw std::logic_error(std::string("broken invariant: ") + what);
}

}  // namespace cohort
