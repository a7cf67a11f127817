#pragma once

#include <algorithm>
#include <cstdint>

namespace cohort {

// Of times that a file says [ns], which may lie further apart than a signed number holds.
inline std::uint64_t TimeBetween(std::int64_t a, std::int64_t b) {
  return static_cast<std::uint64_t>(std::max(a, b)) - static_cast<std::uint64_t>(std::min(a, b));
}

// b - a
inline double TimeFromTo(std::int64_t a, std::int64_t b) {
  const auto between = static_cast<double>(TimeBetween(a, b));
  return a <= b ? between : -between;
}

}  // namespace cohort
