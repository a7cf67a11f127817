#include "pipelines/sfm/cuts.h"

#include <fmt/format.h>

#include <algorithm>

namespace cohort {

std::vector<std::uint32_t> NumbersOf(const std::vector<FrameIndex>& frames) {
  std::vector<std::uint32_t> numbers;
  for (const FrameIndex frame : frames) numbers.push_back(ToInt(frame));
  return numbers;
}

std::string CutsText(const std::vector<FrameIndex>& cuts) {
  constexpr std::size_t kMost = 5;
  const std::size_t named = std::min(cuts.size(), kMost);
  std::string text = cuts.size() == 1 ? "frame " : "frames ";
  for (std::size_t i = 0; i < named; ++i) {
    const bool last = i + 1 == cuts.size();
    text += fmt::format("{}{}", i == 0 ? "" : last ? " and " : ", ", ToInt(cuts[i]));
  }
  if (cuts.size() > named) text += fmt::format(" and {} more", cuts.size() - named);
  return text;
}

}  // namespace cohort
