#include "frontend/storage/output.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <future>
#include <string>
#include <vector>

#include "frontend/core/error.h"
#include "frontend/storage/input_record.h"
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

// As anybody can put one into /tmp.
TEST(OutputFile, IsNotWrittenThroughALinkInItsPlace) {
  const test::TempDir dir;
  WriteBytes(dir / "victim", "precious");
  std::filesystem::create_symlink(dir / "victim", dir / "a.partial");
  std::filesystem::create_symlink(dir / "victim", dir / "a");
  OutputFile out(dir / "a");
  WriteBytes(out.partial(), "new");
  out.Commit();
  EXPECT_EQ(ReadBytes(dir / "victim"), "precious");
  EXPECT_EQ(ReadBytes(dir / "a"), "new");
  EXPECT_FALSE(std::filesystem::is_symlink(dir / "a"));
}

TEST(OutputFile, RemovesNoFolder) {
  const test::TempDir dir;
  std::filesystem::create_directory(dir / "a.partial");
  WriteBytes(dir / "a.partial" / "thesis.tex", "years");
  EXPECT_THAT(
      [&] { OutputFile out(dir / "a"); },
      ThrowsMessage<Error>(HasSubstr("a.partial: a folder of that name exists, remove it")));
  EXPECT_EQ(ReadBytes(dir / "a.partial" / "thesis.tex"), "years");
}

TEST(OutputFile, AFullDiskIsAnError) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  EXPECT_THAT([] { WriteBytes("/dev/full", std::string(100'000, 'x')); },
              ThrowsMessage<Error>(HasSubstr("No space left")));
}

TEST(OutputFile, ADeviceOrAPipeIsNoPlaceForAFile) {
  const test::TempDir dir;
  ASSERT_EQ(mkfifo((dir / "pipe").c_str(), 0600), 0);
  for (const std::string path : {"/dev/null", "/dev/stdout", "/proc/self/fd/1", "/dev/new"}) {
    EXPECT_THAT([&] { CheckOutputPath(path); }, ThrowsMessage<Error>(HasSubstr("it is not a file")))
        << path;
  }
  EXPECT_THAT([&] { OutputFile out(dir / "pipe"); },
              ThrowsMessage<Error>(HasSubstr("it is not a file")));
  EXPECT_TRUE(std::filesystem::is_fifo(dir / "pipe"));
  EXPECT_THAT([] { CheckOutputPath("-"); }, ThrowsMessage<Error>(HasSubstr("standard output")));
}

TEST(InputRecord, NoOutputTakesThePlaceOfAFileThatTheRunReads) {
  const test::TempDir dir;
  const InputRecord record;
  std::filesystem::create_directory(dir / "folder");
  std::filesystem::create_directory_symlink("folder", dir / "link");
  WriteBytes(dir / "folder/a", "precious");
  WriteBytes(dir / "folder/b", "other");
  {
    OutputFile early(dir / "folder/a");
    WriteBytes(early.partial(), "new");
    static_cast<void>(ReadBytes(dir / "link/a"));
    EXPECT_THAT([&] { early.Commit(); },
                ThrowsMessage<Error>(HasSubstr("this run reads that file")));
  }
  EXPECT_THAT([&] { CheckOutputPath(dir / "folder/../folder/a"); },
              ThrowsMessage<Error>(HasSubstr("this run reads that file")));
  EXPECT_THAT(
      [&] {
        OutputFolder out(dir / "folder", {"a", "b"});
      },
      ThrowsMessage<Error>(HasSubstr("folder/a; give another folder")));
  EXPECT_EQ(ReadBytes(dir / "folder/a"), "precious");
  EXPECT_NO_THROW(CheckOutputPath(dir / "folder/b"));
  WriteBytes(dir / "folder/c.partial", "precious");
  static_cast<void>(ReadBytes(dir / "folder/c.partial"));
  EXPECT_THAT([&] { CheckOutputPath(dir / "folder/c"); },
              ThrowsMessage<Error>(HasSubstr("c.partial, the temporary name of that output")));
  std::filesystem::create_directory(dir / "out.partial");
  WriteBytes(dir / "out.partial/a", "precious");
  static_cast<void>(ReadBytes(dir / "out.partial/a"));
  EXPECT_THAT([&] { OutputFolder out(dir / "out", {"a"}); },
              ThrowsMessage<Error>(HasSubstr("out.partial/a; give another folder")));
  InputRecord::Forget(dir / "folder/a");
  EXPECT_NO_THROW(CheckOutputPath(dir / "folder/a"));
}

TEST(InputRecord, WhatIsReadOfTheRunsOwnFileIsNoInput) {
  const InputRecord of_the_run;
  const test::TempDir dir;
  WriteBytes(dir / "a", "old");
  {
    const OwnFile own(dir / "a");
    static_cast<void>(ReadBytes(dir / "a"));
    EXPECT_FALSE(InputRecord::Holds(dir / "a"));
  }
  EXPECT_FALSE(InputRecord::Holds(dir / "a"));
  static_cast<void>(ReadBytes(dir / "a"));
  {
    const OwnFile own(dir / "a");
    EXPECT_TRUE(InputRecord::Holds(dir / "a")) << "what was an input stays one";
  }
  EXPECT_TRUE(InputRecord::Holds(dir / "a"));
}

TEST(InputRecord, IsOfTheProgramAlone) {
  const test::TempDir dir;
  WriteBytes(dir / "a", "old");
  static_cast<void>(ReadBytes(dir / "a"));
  EXPECT_NO_THROW(CheckOutputPath(dir / "a"));
}

TEST(OutputFile, IsWholeWhileSeveralWriteIt) {
  constexpr std::size_t kBytes = 20'000;
  const test::TempDir dir;
  const std::filesystem::path path = dir / "a";
  WriteBytes(path, std::string(kBytes, '0'));
  std::vector<std::future<void>> writers;
  for (const char letter : {'1', '2', '3', '4'}) {
    writers.push_back(std::async(std::launch::async, [&path, letter] {
      for (int i = 0; i < 100; ++i) {
        OutputFile out(path);
        WriteBytes(out.partial(), std::string(kBytes, letter));
        out.Commit();
      }
    }));
  }
  const auto at_work = [&writers] {
    return std::ranges::any_of(writers, [](const std::future<void>& writer) {
      return writer.wait_for(std::chrono::seconds(0)) != std::future_status::ready;
    });
  };
  while (at_work()) {
    const std::string bytes = ReadBytes(path);
    ASSERT_EQ(bytes, std::string(kBytes, bytes.empty() ? '?' : bytes.front()));
  }
  for (std::future<void>& writer : writers) EXPECT_NO_THROW(writer.get());
}

TEST(Outputs, AreDistinctFiles) {
  const test::TempDir dir;
  EXPECT_NO_THROW(CheckDistinctOutputs({{"--out", "a"}, {"--json", ""}, {"--csv", ""}}));
  EXPECT_THAT(
      [&] {
        CheckDistinctOutputs({{"--out", dir / "a"}, {"--json", dir / "x/../a"}});
      },
      ThrowsMessage<UsageError>(HasSubstr("--out and --json are both")));
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

TEST(OutputFolder, MayEndWithADotAndIsNotTheCurrentOne) {
  const test::TempDir dir;
  std::filesystem::create_directories(dir / "model/inner");
  {
    OutputFolder out(dir / "model/inner/.", {"a"});
    WriteBytes(out.partial() / "a", "new");
    out.Commit();
  }
  EXPECT_EQ(ReadBytes(dir / "model/inner/a"), "new");
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(dir / "model/inner");
  for (const char* here : {".", "./", "../inner"}) {
    EXPECT_THAT([&] { OutputFolder out(here, {"a"}); },
                ThrowsMessage<Error>(HasSubstr("it is the current one")))
        << here;
  }
  std::filesystem::current_path(before);
  EXPECT_EQ(ReadBytes(dir / "model/inner/a"), "new");
}

TEST(OutputFile, ANameThatLeavesNoRoomForOthersBesideItIsAnError) {
  const test::TempDir dir;
  EXPECT_NO_THROW(OutputFile(dir / std::string(230, 'a')));
  EXPECT_THAT([&] { OutputFile(dir / std::string(231, 'a')); },
              ThrowsMessage<Error>(HasSubstr("its name is longer than 230 bytes")));
}

TEST(OutputFolder, IsNotWrittenThroughALinkInItsPlace) {
  const test::TempDir dir;
  std::filesystem::create_directory(dir / "elsewhere");
  WriteBytes(dir / "elsewhere" / "a", "precious");
  for (const char* name : {"model", "model.partial"}) {
    std::filesystem::create_directory_symlink(dir / "elsewhere", dir / name);
  }
  OutputFolder out(dir / "model", {"a"});
  WriteBytes(out.partial() / "a", "new");
  out.Commit();
  EXPECT_EQ(ReadBytes(dir / "elsewhere" / "a"), "precious");
  EXPECT_EQ(ReadBytes(dir / "model" / "a"), "new");
}

// As /tmp is one: before hours of work, not after them.
TEST(OutputFolder, OfAnotherUserInASharedFolderIsNotReplaced) {
  if (geteuid() != 0) GTEST_SKIP() << "only root can be two users";
  const test::TempDir dir;
  std::filesystem::create_directory(dir / "model");
  WriteBytes(dir / "a", "old");
  ASSERT_EQ(chmod(dir.path().c_str(), 01777), 0);
  ASSERT_EQ(seteuid(65533), 0);
  EXPECT_THAT([&] { OutputFolder out(dir / "model", {"a"}); },
              ThrowsMessage<Error>(HasSubstr("model: it is another user's; give another name")));
  EXPECT_THAT([&] { OutputFile out(dir / "a"); },
              ThrowsMessage<Error>(HasSubstr("a: it is another user's; give another name")));
  EXPECT_NO_THROW(OutputFile out(dir / "b"));
  ASSERT_EQ(seteuid(0), 0);
}

TEST(OutputFolder, RefusesToReplaceAFolderWithForeignFiles) {
  const test::TempDir dir;
  std::filesystem::create_directory(dir / "home");
  WriteBytes(dir / "home" / "thesis.tex", "years");
  EXPECT_THAT([&] { OutputFolder out(dir / "home", {"a"}); },
              ThrowsMessage<Error>(HasSubstr("holds thesis.tex")));
  EXPECT_EQ(ReadBytes(dir / "home" / "thesis.tex"), "years");
}

TEST(OutputFolder, RefusesOneThatWasWrittenByOthersUnderTheSameNames) {
  const test::TempDir dir;
  const auto has_mark = [](const std::filesystem::path& folder) {
    return std::filesystem::exists(folder / "mark");
  };
  const auto open = [&] { OutputFolder out(dir / "model", {"a", "mark"}, has_mark); };
  std::filesystem::create_directory(dir / "model");
  EXPECT_NO_THROW(open());
  WriteBytes(dir / "model/a", "precious");
  EXPECT_THAT(open, ThrowsMessage<Error>(HasSubstr("were not written by cohort")));
  EXPECT_EQ(ReadBytes(dir / "model/a"), "precious");
  WriteBytes(dir / "model/mark", "");
  EXPECT_NO_THROW(open());
}

// Only what a killed run may have left there is removed.
TEST(OutputFolder, RefusesToRemoveAPartialFolderWithForeignFiles) {
  const test::TempDir dir;
  const auto open = [&] { OutputFolder out(dir / "s", {"a"}); };
  std::filesystem::create_directory(dir / "s.partial");
  WriteBytes(dir / "s.partial/a", "half");
  WriteBytes(dir / "s.partial/a.partial-journal", "half");
  EXPECT_NO_THROW(open());
  std::filesystem::create_directory(dir / "s.partial");
  WriteBytes(dir / "s.partial/thesis.tex", "years");
  EXPECT_THAT(open, ThrowsMessage<Error>(HasSubstr("s.partial holds thesis.tex")));
  EXPECT_EQ(ReadBytes(dir / "s.partial/thesis.tex"), "years");
}

TEST(OutputFolder, ALinkToNothingIsSaidBeforeTheWork) {
  const test::TempDir dir;
  std::filesystem::create_directory_symlink("nowhere", dir / "out");
  EXPECT_THAT([&] { OutputFolder out(dir / "out", {"a"}); },
              ThrowsMessage<Error>(HasSubstr("a dangling link")));
}

TEST(OutputFile, NothingThatTookItsPlaceIsRenamed) {
  const test::TempDir dir;
  WriteBytes(dir / "a", "old");
  {
    OutputFile out(dir / "a");
    WriteBytes(dir / "other", "of another run");
    std::filesystem::rename(dir / "other", out.partial());
    EXPECT_THAT([&] { out.Commit(); },
                ThrowsMessage<Error>(HasSubstr("has been replaced by something else")));
  }
  EXPECT_EQ(ReadBytes(dir / "a"), "old");
  EXPECT_EQ(ReadBytes(dir / "a.partial"), "of another run");
  OutputFile out(dir / "a");
  WriteBytes(dir / "b", "new");
  std::filesystem::rename(dir / "b", out.partial());
  out.LockAnew();
  out.Commit();
  EXPECT_EQ(ReadBytes(dir / "a"), "new");
}

TEST(OutputFolder, ReplacesNothingThatCameWhileTheRunWorked) {
  const test::TempDir dir;
  std::filesystem::create_directory(dir / "model");
  {
    OutputFolder out(dir / "model", {"a"});
    WriteBytes(out.partial() / "a", "new");
    WriteBytes(dir / "model/thesis.tex", "years");
    EXPECT_THAT([&] { out.Commit(); }, ThrowsMessage<Error>(HasSubstr("holds thesis.tex")));
  }
  EXPECT_EQ(ReadBytes(dir / "model/thesis.tex"), "years");
  EXPECT_FALSE(std::filesystem::exists(dir / "model.partial"));
  {
    OutputFolder out(dir / "new", {"a"});
    WriteBytes(dir / "new", "a file");
    EXPECT_THAT([&] { out.Commit(); }, ThrowsMessage<Error>(HasSubstr("it is a file")));
  }
  EXPECT_EQ(ReadBytes(dir / "new"), "a file");
}

}  // namespace
}  // namespace cohort
