#include "frontend/tracks/frame_name.h"

#include <fmt/format.h>

#include <algorithm>

namespace cohort {
namespace {

constexpr std::string_view kNameBegin = "frame_";
constexpr std::string_view kNameEnd = ".png";
constexpr std::size_t kNameDigits = 6;

}  // namespace

std::string NumberedFrameName(FrameIndex frame) {
  return fmt::format("{}{:0{}}{}", kNameBegin, ToInt(frame), kNameDigits, kNameEnd);
}

bool IsNumberedFrameName(std::string_view name) {
  if (!name.starts_with(kNameBegin) || !name.ends_with(kNameEnd)) return false;
  name.remove_prefix(kNameBegin.size());
  name.remove_suffix(std::min(name.size(), kNameEnd.size()));
  return name.size() >= kNameDigits &&
         std::ranges::all_of(name, [](char c) { return c >= '0' && c <= '9'; });
}

}  // namespace cohort
