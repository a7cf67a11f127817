#include "frontend/storage/write_lock.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <system_error>
#include <thread>
#include <vector>

#include "frontend/core/error.h"
#include "frontend/storage/output.h"
#include "frontend/tracks/track_store.h"
#include "tests/support/temp_dir.h"

// As NFS locks (flock(2)): all bytes, and what is open for it only.
static bool g_locks_are_of_bytes = false;
// NOLINTNEXTLINE(readability-inconsistent-declaration-parameter-name): the system's are reserved
extern "C" int flock(int descriptor, int operation) noexcept {
  if (!g_locks_are_of_bytes) return static_cast<int>(syscall(SYS_flock, descriptor, operation));
  struct flock all {};
  all.l_type = (operation & LOCK_UN) != 0   ? F_UNLCK
               : (operation & LOCK_SH) != 0 ? F_RDLCK
                                            : F_WRLCK;
  const int end = fcntl(descriptor, (operation & LOCK_NB) != 0 ? F_OFD_SETLK : F_OFD_SETLKW, &all);
  if (end != 0 && errno == EAGAIN) errno = EWOULDBLOCK;
  return end;
}

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

// What a run holds there keeps SQLite away from its own file.
TEST(WriteLock, IsNoneWhereItWouldBeOfTheBytesThatSqliteLocks) {
  const test::TempDir dir;
  const std::string path = dir / "a.tracks";
  g_locks_are_of_bytes = true;
  {
    TrackFile file;
    file.width_px = file.height_px = 8;
    file.frames = {{FrameIndex{0}, "0.png", 0}};
    WriteTrackFile(path, file);
    WriteTrackFile(path, file);
    const WriteLock lock = WriteLock::Of(path);
    EXPECT_EQ(ReadTrackFile(path).frames.size(), 1u);
    const WriteLock alone = WriteLock::OfLockFile(dir / "lock");
    EXPECT_THAT([&] { WriteLock::OfLockFile(dir / "lock"); },
                ThrowsMessage<Error>(HasSubstr("another run")));
  }
  g_locks_are_of_bytes = false;
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
