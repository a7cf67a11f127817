#include "frontend/core/write_lock.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <optional>
#include <thread>

#include "frontend/core/error.h"
#include "frontend/core/output.h"
#include "tests/support/temp_dir.h"

// A lock is of an opened file, so that one process can stand for two runs.
namespace cohort {
namespace {

namespace fs = std::filesystem;
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
