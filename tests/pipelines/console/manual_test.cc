// The manual pages hold what --help-all shows, and the real groff and man find no fault in them.

#include "pipelines/console/manual.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <regex>

#include "pipelines/commands/all_commands.h"
#include "pipelines/sfm/version.h"
#include "tests/support/shell.h"

namespace cohort {
namespace {

using testing::HasSubstr;

std::string FullHelpOf(const Command& command) {
  testing::internal::CaptureStdout();
  EXPECT_EQ(command.run(std::vector<std::string>{"--help-all"}), 0);
  return testing::internal::GetCapturedStdout();
}

// `page` as groff prints it on a terminal; the words of a line may stand in two.
std::string Rendered(const std::string& page) {
  const test::TempDir dir;
  WriteBytes(dir / "page.1", page);
  const test::ProgramEnd end =
      test::RunShell(fmt::format("groff -man -ww -Tascii -P-cbou '{}'", (dir / "page.1").string()));
  EXPECT_EQ(end.exit_code, 0);
  EXPECT_EQ(end.err, "");
  return std::regex_replace(end.out, std::regex("\\s+"), " ");
}

bool Misses(const std::string& program) {
  return test::RunShell("command -v " + program).exit_code != 0;
}

TEST(Manual, HasEveryOptionOfTheHelp) {
  if (Misses("groff")) GTEST_SKIP() << "no groff";
  static const std::regex kOption(R"(--[\w.\[\]-]*\w)");
  for (const Command& command : AllCommands()) {
    SCOPED_TRACE(command.name);
    const std::string page = Rendered(ManualOfCommand(command));
    const std::string help = FullHelpOf(command);
    int options = 0;
    for (auto it = std::sregex_iterator(help.begin(), help.end(), kOption);
         it != std::sregex_iterator();
         ++it) {
      EXPECT_THAT(page, HasSubstr(it->str()));
      ++options;
    }
    EXPECT_GE(options, 6);
  }
}

// Word by word, so that nothing that roff takes for its own gets lost.
TEST(Manual, SaysWhatTheHelpSays) {
  if (Misses("groff")) GTEST_SKIP() << "no groff";
  for (const Command& command : AllCommands()) {
    SCOPED_TRACE(command.name);
    const std::string page = Rendered(ManualOfCommand(command));
    EXPECT_THAT(page, HasSubstr(command.usage));
    EXPECT_THAT(page, HasSubstr(command.summary));
    for (const OptionHelp& option : command.options) EXPECT_THAT(page, HasSubstr(option.text));
  }
}

TEST(Manual, OfTheProgramHasEveryCommand) {
  if (Misses("groff")) GTEST_SKIP() << "no groff";
  const std::string page = Rendered(ManualOfProgram(AllCommands()));
  for (const Command& command : AllCommands()) {
    EXPECT_THAT(page, HasSubstr(" cohort " + command.name + " " + command.usage));
    EXPECT_THAT(page, HasSubstr(command.summary + "."));
    EXPECT_THAT(page, HasSubstr("cohort-" + command.name + "(1)"));
  }
}

TEST(Manual, IsFreeOfWhatManWarnsOf) {
  if (Misses("man")) GTEST_SKIP() << "no man";
  const test::TempDir dir;
  std::vector<std::string> pages{ManualOfProgram(AllCommands())};
  for (const Command& command : AllCommands()) pages.push_back(ManualOfCommand(command));
  for (const std::string& page : pages) {
    WriteBytes(dir / "page.1", page);
    const test::ProgramEnd end = test::RunShell(
        fmt::format("MANWIDTH=80 MANROFFSEQ='' man --warnings -E UTF-8 -Tutf8 -Z -l '{}'",
                    (dir / "page.1").string()));
    EXPECT_EQ(end.exit_code, 0);
    EXPECT_EQ(end.err, "") << page.substr(0, 100);
    EXPECT_GT(end.out.size(), 1000u);
  }
}

TEST(Manual, CarriesTheVersionAndNoDate) {
  for (const Command& command : AllCommands()) {
    if (command.name != "track") continue;
    EXPECT_THAT(
        ManualOfCommand(command),
        HasSubstr(fmt::format(".TH \"COHORT\\-TRACK\" \"1\" \"\" \"cohort {}\"", kVersion)));
  }
}

}  // namespace
}  // namespace cohort
