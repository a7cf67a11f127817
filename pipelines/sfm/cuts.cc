#include "pipelines/sfm/cuts.h"

#include <fmt/format.h>

#include <algorithm>

#include "datasets/readers/sequence.h"

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

std::string FramesOption(const TrackFile& file, FrameIndex first, std::optional<FrameIndex> end) {
  const FrameRange read =
      file.meta.frames.empty() ? FrameRange{} : FrameRange::Parse(file.meta.frames);
  const std::optional<std::uint32_t> last = end ? ToInt(*end) : read.end;
  std::string option = fmt::format("--frames {}:", ToInt(first));
  if (last) option += fmt::format("{}", *last);
  if (read.stride > 1) option += fmt::format(":{}", read.stride);
  return option;
}

}  // namespace cohort
