#include "frontend/core/output.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "frontend/core/error.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(OutputFile, KeepsTheOldFileUntilItIsWhole) {
  const test::TempDir dir;
  WriteBytes(dir / "a", "old");
  {
    OutputFile out(dir / "a");
    WriteBytes(out.partial(), "half");
  }
  EXPECT_EQ(ReadBytes(dir / "a"), "old");
  EXPECT_FALSE(std::filesystem::exists(dir / "a.partial"));
  OutputFile out(dir / "a");
  WriteBytes(out.partial(), "new");
  out.Commit();
  EXPECT_EQ(ReadBytes(dir / "a"), "new");
}

TEST(OutputFile, NamesAFolderThatIsMissing) {
  const test::TempDir dir;
  EXPECT_THAT([&] { OutputFile out(dir / "no/a"); },
              ThrowsMessage<Error>(HasSubstr("there is no folder")));
  EXPECT_THAT([&] { OutputFile out(dir.path()); }, ThrowsMessage<Error>(HasSubstr("is a folder")));
}

TEST(OutputFile, AFullDiskIsAnError) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  EXPECT_THAT([] { WriteBytes("/dev/full", std::string(100'000, 'x')); },
              ThrowsMessage<Error>(HasSubstr("No space left")));
}

TEST(OutputFolder, ReplacesItsOwnFolderWhole) {
  const test::TempDir dir;
  for (const char* content : {"old", "new"}) {
    OutputFolder out(dir / "model/", {"a"});
    WriteBytes(out.partial() / "a", content);
    out.Commit();
  }
  EXPECT_EQ(ReadBytes(dir / "model" / "a"), "new");
  EXPECT_FALSE(std::filesystem::exists(dir / "model.partial"));
}

TEST(OutputFolder, RefusesToReplaceAFolderWithForeignFiles) {
  const test::TempDir dir;
  std::filesystem::create_directory(dir / "home");
  WriteBytes(dir / "home" / "thesis.tex", "years");
  EXPECT_THAT([&] { OutputFolder out(dir / "home", {"a"}); },
              ThrowsMessage<Error>(HasSubstr("holds thesis.tex")));
  EXPECT_EQ(ReadBytes(dir / "home" / "thesis.tex"), "years");
}

}  // namespace
}  // namespace cohort
