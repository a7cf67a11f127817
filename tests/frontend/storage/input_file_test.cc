#include "frontend/storage/input_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <string>

#include "frontend/core/error.h"
#include "frontend/storage/line_reader.h"
#include "frontend/storage/output.h"
#include "tests/support/child_process.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

// A pipe that nobody writes into would be waited for, a device never ends.
TEST(InputFile, IsNoFolderPipeOrDevice) {
  const test::TempDir dir;
  ASSERT_EQ(mkfifo((dir / "pipe").c_str(), 0600), 0);
  for (const std::string& path : {(dir / "pipe").string(), std::string("/dev/zero")}) {
    EXPECT_THAT([&] { ReadBytes(path); }, ThrowsMessage<Error>(HasSubstr("a pipe, a socket")));
    EXPECT_THAT([&] { LineReader reader(path); }, ThrowsMessage<Error>(HasSubstr(path)));
    EXPECT_THAT([&] { OpenInputDescriptor(path); }, ThrowsMessage<Error>(HasSubstr(path)));
  }
  EXPECT_THAT([&] { ReadBytes(dir.path()); }, ThrowsMessage<Error>(HasSubstr("it is a folder")));
  EXPECT_THAT([&] { LineReader reader(dir.path()); },
              ThrowsMessage<Error>(HasSubstr("it is a folder")));
}

TEST(InputFile, ThatMayNotBeReadIsAnError) {
  const test::TempDir dir;
  std::filesystem::permissions(dir.path(), std::filesystem::perms(0755));
  WriteBytes(dir / "secret", "x");
  std::filesystem::permissions(dir / "secret", std::filesystem::perms::none);
  const std::string path = dir / "secret";
  for (const auto& read : {+[](const std::string& p) { ReadBytes(p); },
                           +[](const std::string& p) { LineReader reader(p); }}) {
    EXPECT_EQ(test::RunInChild([&] {
                test::DropRoot();
                read(path);
                return std::string("read");
              }),
              "threw: cannot read " + path + ": Permission denied");
  }
}

// 1 TB that takes no room on the disk: nothing of it is read.
TEST(InputFile, OfMoreThanItMayHaveIsAnError) {
  const test::TempDir dir;
  WriteBytes(dir / "a", "12345");
  EXPECT_EQ(ReadBytes(dir / "a", 5), "12345");
  EXPECT_THAT([&] { ReadBytes(dir / "a", 4); }, ThrowsMessage<Error>(HasSubstr("the 4 bytes")));
  std::error_code error;
  std::filesystem::resize_file(dir / "a", std::uintmax_t{1} << 40, error);
  if (error) GTEST_SKIP() << "no sparse files here";
  EXPECT_THAT([&] { ReadBytes(dir / "a"); }, ThrowsMessage<Error>(HasSubstr("4294967296 bytes")));
}

// Its size says 0.
TEST(InputFile, OfTheKernelIsReadToItsEnd) {
  EXPECT_THAT(ReadBytes("/proc/self/status"), HasSubstr("Name:"));
}

TEST(LineReader, RefusesALineWithoutEnd) {
  const test::TempDir dir;
  const std::string line(70'000, 'x');
  WriteBytes(dir / "a", "short\r\n" + line);
  LineReader reader(dir / "a");
  ASSERT_TRUE(reader.Next());
  EXPECT_EQ(reader.line(), "short");
  EXPECT_THAT([&] { reader.Next(); }, ThrowsMessage<Error>(HasSubstr("line 2: longer than 65535")));
}

TEST(PictureName, LeadsOutOfNoFolderAndIsOneLine) {
  for (const char* good :
       {"a.png", "rgb/0.png", "..a/b..", "<script>.png", "a;b %d \"'`$(x).png"}) {
    EXPECT_EQ(FaultOfPictureName(good), "") << good;
  }
  EXPECT_EQ(FaultOfPictureName(""), "is empty");
  for (const std::string bad : {"../a", "a/../../b", ".."}) {
    EXPECT_THAT(FaultOfPictureName(bad), HasSubstr("leads out")) << bad;
  }
  EXPECT_THAT(FaultOfPictureName("/etc/passwd"), HasSubstr("absolute"));
  for (const std::string_view bad : {std::string_view("a\nb"),
                                     std::string_view("a\0b", 3),
                                     std::string_view("a\xc2\x9b"
                                                      "b")}) {
    EXPECT_THAT(FaultOfPictureName(bad), HasSubstr("control character"));
  }
}

}  // namespace
}  // namespace cohort
