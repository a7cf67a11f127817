#pragma once

#include <charconv>
#include <optional>
#include <string_view>

namespace cohort {

// A whole number; nullopt for any other text.
inline std::optional<unsigned> ParseUnsigned(std::string_view text) {
  unsigned value = 0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stop != end) return std::nullopt;
  return value;
}

}  // namespace cohort
