#include "frontend/core/error.h"

#include <gtest/gtest.h>

namespace cohort {
namespace {

TEST(OneLine, HasASpaceForEveryControlCharacter) {
  EXPECT_EQ(OneLine("a\nb\r\tc\x1b[2Jd\x7f"), "a b  c [2Jd ");
  EXPECT_EQ(OneLine(std::string_view("a\0b", 3)), "a b");
  EXPECT_EQ(OneLine("Größe, 大きさ"), "Größe, 大きさ");
}

TEST(Error, IsOneLineWhateverIsInIt) {
  EXPECT_STREQ(Error("x.db: malformed schema (a\nb)").what(), "x.db: malformed schema (a b)");
  try {
    ThrowUsageError("option '{}' is unknown", "a\nb");
  } catch (const UsageError& error) {
    EXPECT_STREQ(error.what(), "option 'a b' is unknown");
  }
}

}  // namespace
}  // namespace cohort
