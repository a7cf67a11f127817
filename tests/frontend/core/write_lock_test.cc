#include "frontend/core/write_lock.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "frontend/core/error.h"
#include "frontend/core/output.h"
#include "tests/support/temp_dir.h"

// A lock is of an opened file, so that one process can stand for two runs.
namespace cohort {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(WriteLock, SaysThatAnotherRunWritesTheSameFile) {
  const test::TempDir dir;
  OutputFile first(dir / "a");
  WriteBytes(first.partial(), "first");
  EXPECT_THAT([&] { OutputFile second(dir / "a"); },
              ThrowsMessage<Error>(HasSubstr("another run is writing it")));
  EXPECT_EQ(ReadBytes(first.partial()), "first");
  first.Commit();
  EXPECT_EQ(ReadBytes(dir / "a"), "first");
}

// NFS locks no file that was opened to be read.
TEST(WriteLock, IsOfAFileThatIsOpenForWriting) {
  const test::TempDir dir;
  const std::string path = dir / "a";
  WriteBytes(path, "kept");
  const auto modes = [&path] {
    std::vector<int> found;
    for (const auto& entry : fs::directory_iterator("/proc/self/fd")) {
      std::error_code gone;
      if (fs::read_symlink(entry, gone) != path) continue;
      const int descriptor = std::stoi(entry.path().filename().string());
      found.push_back(fcntl(descriptor, F_GETFL) & O_ACCMODE);
    }
    return found;
  };
  {
    const WriteLock lock = WriteLock::Of(path);
    EXPECT_THAT(modes(), ElementsAre(O_RDWR));
  }
  {
    const auto lock = WriteLock::TryOf(path);
    EXPECT_THAT(modes(), ElementsAre(O_RDWR));
  }
  {
    fs::create_symlink(path, dir / "link");
    const WriteLock lock = WriteLock::Of(dir / "link");
    EXPECT_THAT(modes(), ElementsAre(O_RDONLY)) << "what is behind a link may be anybody's";
  }
  EXPECT_EQ(ReadBytes(path), "kept");
  {
    const WriteLock lock = WriteLock::OfNewFile(path);
    EXPECT_THAT(modes(), ElementsAre(O_WRONLY));
  }
  EXPECT_EQ(ReadBytes(path), "");
}

TEST(WriteLock, WaitsForARunThatIsAboutToEnd) {
  const test::TempDir dir;
  std::optional<OutputFile> first(dir / "a");
  std::jthread end([&first] {
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    WriteBytes(first->partial(), "first");
    first->Commit();
    first.reset();
  });
  OutputFile second(dir / "a");
  EXPECT_EQ(ReadBytes(dir / "a"), "first");
  WriteBytes(second.partial(), "second");
  second.Commit();
  EXPECT_EQ(ReadBytes(dir / "a"), "second");
}

TEST(WriteLock, OfAFolderThatWasSwappedIsThatOfTheNewOne) {
  const test::TempDir dir;
  for (int round = 0; round < 2; ++round) {  // made, then replaced
    OutputFolder out(dir / "model", {"a"});
    WriteBytes(out.partial() / "a", std::to_string(round));
    EXPECT_FALSE(WriteLock::TryOf(out.partial()));
    out.Commit();
    EXPECT_EQ(ReadBytes(dir / "model/a"), std::to_string(round));
    EXPECT_FALSE(WriteLock::TryOf(dir / "model"));
    EXPECT_FALSE(fs::exists(out.partial()));
  }
  EXPECT_TRUE(WriteLock::TryOf(dir / "model"));
}

TEST(WriteLock, WhatAKilledRunLeftIsReplaced) {
  const test::TempDir dir;
  WriteBytes(dir / "file", "half");
  fs::create_directories(dir / "folder/with/more");
  const WriteLock file = WriteLock::OfNewFile(dir / "file");
  const WriteLock folder = WriteLock::OfNewFolder(dir / "folder");
  EXPECT_EQ(ReadBytes(dir / "file"), "");
  EXPECT_TRUE(fs::is_empty(dir / "folder"));
}

TEST(WriteLock, IsSharedByThoseWhoSaySo) {
  const test::TempDir dir;
  const WriteLock first = WriteLock::Of(dir.path(), true);
  const WriteLock second = WriteLock::Of(dir.path(), true);
  EXPECT_FALSE(WriteLock::TryOf(dir.path()));
}

TEST(WriteLock, AQueueWaitsForAsLongAsItTakes) {
  const test::TempDir dir;
  std::optional<WriteLock> first = WriteLock::Await(dir / "lock");
  std::atomic<bool> entered = false;
  std::jthread second([&] {
    const WriteLock lock = WriteLock::Await(dir / "lock");
    entered = true;
  });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_FALSE(entered);
  first.reset();
  second.join();
  EXPECT_TRUE(entered);
  EXPECT_EQ(ReadBytes(dir / "lock"), "");
  EXPECT_THAT([&] { WriteLock::Await(dir / "no/lock"); },
              ThrowsMessage<Error>(HasSubstr("no/lock")));
}

}  // namespace
}  // namespace cohort
