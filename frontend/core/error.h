#pragma once

#include <fmt/format.h>

#include <stdexcept>
#include <utility>

namespace cohort {

// Bad input or a resource that fails: what() is one line naming what, where and what to do.
// The commands print it as `cohort: error: ...` and exit 1.
class Error : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
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
