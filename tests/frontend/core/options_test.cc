#include "frontend/core/options.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "frontend/track/tracker_options.h"

namespace cohort {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(ValidateOptions, NamesTheFieldAndTheBounds) {
  TrackerOptions options;
  EXPECT_NO_THROW(ValidateOptions(options));
  options.klt.max_level = 9;
  EXPECT_THAT(
      [&] { ValidateOptions(options); },
      ThrowsMessage<UsageError>(AllOf(HasSubstr("klt.max_level = 9"), HasSubstr("from 0 to 8"))));
}

// A patch has a middle pixel.
TEST(ValidateOptions, SidesOfPatchesAreOdd) {
  const std::vector<std::pair<const char*, std::function<int&(TrackerOptions&)>>> sides{
      {"klt.window_px", [](TrackerOptions& o) -> int& { return o.klt.window_px; }},
      {"anchored_klt.window_px",
       [](TrackerOptions& o) -> int& { return o.anchored_klt.window_px; }},
      {"rlof.window_px", [](TrackerOptions& o) -> int& { return o.rlof.window_px; }},
      {"subspace.template_px", [](TrackerOptions& o) -> int& { return o.subspace.template_px; }},
      {"measurement.window_px",
       [](TrackerOptions& o) -> int& { return o.measurement.patch.window_px; }},
      {"measurement.wide_window_px",
       [](TrackerOptions& o) -> int& { return o.measurement.patch.wide_window_px; }}};
  for (const auto& [name, side] : sides) {
    TrackerOptions options;
    side(options) = 15;
    EXPECT_NO_THROW(ValidateOptions(options)) << name;
    side(options) = 16;
    EXPECT_THAT([&] { ValidateOptions(options); },
                ThrowsMessage<UsageError>(AllOf(HasSubstr(std::string(name) + " = 16 is even"),
                                                HasSubstr("give an odd number from"))));
  }
}

}  // namespace
}  // namespace cohort
