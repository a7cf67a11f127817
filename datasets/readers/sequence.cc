#include "datasets/readers/sequence.h"

#include <algorithm>
#include <charconv>
#include <string_view>
#include <vector>

#include "frontend/core/error.h"

namespace cohort {

FrameRange FrameRange::Parse(const std::string& text) {
  const auto fail = [&](std::string_view why) {
    ThrowUsageError(
        "frame range '{}': {}; give A:B or A:B:STEP, for example 0:300, 100: or ::5", text, why);
  };
  std::vector<std::optional<std::uint32_t>> parts;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t colon = std::min(text.find(':', begin), text.size());
    parts.emplace_back();
    if (colon > begin) {
      const char* const end = text.data() + colon;
      const auto [rest, error] = std::from_chars(text.data() + begin, end, parts.back().emplace());
      if (error != std::errc() || rest != end) fail("not whole numbers from 0 on");
    }
    begin = colon + 1;
  }
  if (parts.size() < 2 || parts.size() > 3) fail("not two or three numbers");
  parts.resize(3);

  const FrameRange range{parts[0].value_or(0), parts[1], parts[2].value_or(1)};
  if (range.stride == 0) fail("the step is 0");
  if (range.end && *range.end <= range.first) fail("it holds no frame");
  return range;
}

std::size_t FrameRange::Count(std::size_t source_frames) const {
  const std::size_t last = end ? std::min<std::size_t>(*end, source_frames) : source_frames;
  return last <= first ? 0 : (last - first - 1) / stride + 1;
}

}  // namespace cohort
