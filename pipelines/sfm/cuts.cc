#include "pipelines/sfm/cuts.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

namespace cohort {

void NoteCuts(const std::vector<FrameIndex>& cuts, std::map<std::string, std::string>& meta) {
  if (cuts.empty()) return;
  std::string text;
  for (const FrameIndex cut : cuts)
    text += fmt::format("{}{}", text.empty() ? "" : " ", ToInt(cut));
  meta[kCutsMeta] = text;
}

std::vector<FrameIndex> CutsOf(const TrackFile& file) {
  std::vector<FrameIndex> cuts;
  const auto noted = file.meta.find(kCutsMeta);
  if (noted == file.meta.end()) return cuts;
  std::istringstream words(noted->second);
  for (std::uint32_t frame = 0; words >> frame;) cuts.push_back(FrameIndex{frame});
  return cuts;
}

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
