#include "frontend/core/child_process.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include "frontend/core/error.h"
#include "frontend/core/interruption.h"
#include "frontend/core/stopwatch.h"
#include "frontend/storage/output.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

ProgramOutput Shell(const std::string& line, double limit_seconds = 0.0) {
  return RunProgramForText("/bin/sh", {"-c", line}, std::chrono::duration<double>(limit_seconds));
}

TEST(ChildProcess, TellsHowItEnded) {
  EXPECT_EQ(Shell("exit 3").end.Brief(), "exit code 3");
  EXPECT_EQ(Shell("kill -SEGV $$").end.Brief(), "killed by signal 11");
  const ProgramOutput both = Shell("echo out; echo err >&2");
  EXPECT_EQ(both.end.Brief(), "exit code 0");
  EXPECT_EQ(both.text, "out\nerr\n");
}

// As root's folders are to others; here of a name that no folder can have.
TEST(FindProgram, GoesOnBehindAFolderThatCannotBeEntered) {
  const std::string path = std::getenv("PATH");
  const std::string locked = "/" + std::string(300, 'a') + ":";
  ASSERT_EQ(setenv("PATH", (locked + path).c_str(), 1), 0);
  EXPECT_EQ(FindProgram("sh").value_or("").filename(), "sh");
  ASSERT_EQ(setenv("PATH", path.c_str(), 1), 0);
}

TEST(ChildProcess, IsKilledAtItsTimeLimit) {
  const Stopwatch stopwatch;
  const ProgramOutput late = Shell("echo $$; exec sleep 60", 0.2);
  EXPECT_LT(stopwatch.Seconds(), 30.0);
  EXPECT_TRUE(late.end.out_of_time);
  EXPECT_EQ(late.end.Brief(), "killed at its time limit");
  EXPECT_NE(kill(std::stoi(late.text), 0), 0) << "it still runs";
  EXPECT_FALSE(Shell("exit 0", 60.0).end.out_of_time);
}

TEST(ChildProcess, IsKilledWhereItPrintsWithoutEnd) {
  const Stopwatch stopwatch;
  const ProgramOutput endless = Shell("exec yes", 600.0);
  EXPECT_LT(stopwatch.Seconds(), 300.0);
  EXPECT_TRUE(endless.end.printed_too_much);
  EXPECT_EQ(endless.end.Brief(), "killed as it printed without end");
  EXPECT_EQ(endless.text.size(), std::size_t{1} << 24);
  EXPECT_FALSE(Shell("head -c 16777216 /dev/zero").end.printed_too_much);
}

TEST(ChildProcess, EndsWhereTheJobIsInterrupted) {
  const test::TempDir dir;
  const std::string pid_file = dir / "pid";
  const InterruptionCheck check([&] {
    if (std::filesystem::exists(pid_file)) ThrowError("interrupted");
  });
  EXPECT_THAT(
      [&] {
        Shell("echo $$ > " + pid_file + ".partial && mv " + pid_file + ".partial " + pid_file +
              "; exec sleep 60");
      },
      ThrowsMessage<Error>(HasSubstr("interrupted")));
  EXPECT_NE(kill(std::stoi(ReadBytes(pid_file)), 0), 0) << "it still runs";
}

TEST(ChildProcess, ThatCannotBeStartedIsAnError) {
  const test::TempDir dir;
  WriteBytes(dir / "program", "no program at all");
  std::filesystem::permissions(dir / "program", std::filesystem::perms::owner_all);
  EXPECT_THAT([&] { RunProgramForText(dir / "program", {}); },
              ThrowsMessage<Error>(HasSubstr("Exec format error")));
  EXPECT_THAT([&] { RunProgramForText(dir / "missing", {}); },
              ThrowsMessage<Error>(HasSubstr("No such file")));
}

// Others count on dying where nobody reads what they write, whatever we do ourselves.
TEST(ChildProcess, HasTheUsualHandlingOfBrokenPipes) {
  const auto old = signal(SIGPIPE, SIG_IGN);
  EXPECT_EQ(Shell("kill -PIPE $$; echo still here").end.signal, SIGPIPE);
  signal(SIGPIPE, old);
}

TEST(ChildProcess, EndsWhereTheEndOfChildrenIsIgnored) {
  const auto old = signal(SIGCHLD, SIG_IGN);
  EXPECT_EQ(Shell("exit 3").end.exit_code, 3);
  EXPECT_EQ(signal(SIGCHLD, old), SIG_IGN);
}

}  // namespace
}  // namespace cohort
