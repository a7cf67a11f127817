#include "frontend/core/error.h"

#include <gtest/gtest.h>

namespace cohort {
namespace {

TEST(OneLine, HasASpaceForEveryControlCharacter) {
  EXPECT_EQ(OneLine("a\nb\r\tc\x1b[2Jd\x7f"), "a b  c [2Jd ");
  EXPECT_EQ(OneLine(std::string_view("a\0b", 3)), "a b");
  EXPECT_EQ(OneLine("Größe, 大きさ"), "Größe, 大きさ");
}

// U+009B begins codes that terminals obey, U+2028 is a line's end.
TEST(OneLine, KnowsTheControlCharactersOfUtf8) {
  EXPECT_EQ(OneLine("a\xc2\x9b"
                    "2Jb\xe2\x80\xa8"
                    "c"),
            "a  2Jb   c");
  EXPECT_EQ(OneLine("\xc2\xa0\xe2\x80\xa6\xc2"), "\xc2\xa0\xe2\x80\xa6\xc2");
}

TEST(Error, QuotesOnlySoMuch) {
  const std::string what = Error("'" + std::string(1 << 20, 'x') + "' is no number").what();
  EXPECT_LT(what.size(), 9000u);
  EXPECT_TRUE(what.ends_with(" ..."));
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
