#pragma once

#include <algorithm>
#include <cstdint>

namespace cohort {

// The difference of times from a file [ns], which may exceed the range of a signed number.
inline std::uint64_t TimeBetween(std::int64_t a, std::int64_t b) {
  return static_cast<std::uint64_t>(std::max(a, b)) - static_cast<std::uint64_t>(std::min(a, b));
}

// b - a
inline double TimeFromTo(std::int64_t a, std::int64_t b) {
  const auto between = static_cast<double>(TimeBetween(a, b));
  return a <= b ? between : -between;
}

}  // namespace cohort
