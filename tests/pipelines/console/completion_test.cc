// The completions, in the real shells.

#include "pipelines/console/completion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

#include "pipelines/commands/all_commands.h"
#include "tests/support/shell.h"

namespace cohort {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::Each;
using testing::ElementsAre;
using testing::IsEmpty;
using testing::IsSupersetOf;
using testing::Not;
using testing::StartsWith;
using testing::UnorderedElementsAre;

std::vector<std::string> LinesOf(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

// What a shell prints after its replies to one line.
constexpr const char* kEnd = "(no more)";

// The replies to each of so many lines.
std::vector<std::vector<std::string>> RepliesIn(const std::string& printed, std::size_t lines) {
  std::vector<std::vector<std::string>> replies(1);
  for (const std::string& line : LinesOf(printed)) {
    if (line == kEnd) {
      replies.emplace_back();
    } else {
      replies.back().push_back(line);
    }
  }
  replies.pop_back();
  EXPECT_EQ(replies.size(), lines);
  replies.resize(lines);
  return replies;
}

// A folder with a clip and a folder in it, where the shells are.
class Completion : public testing::Test {
 protected:
  void SetUp() override {
    WriteBytes(dir_ / "a clip.mp4", "");
    std::filesystem::create_directory(dir_ / "scenes");
    WriteBytes(script_.path() / "cohort", "");
  }

  std::string Write(const std::string& name, const std::string& text) const {
    WriteBytes(script_ / name, text);
    return (script_ / name).string();
  }

  test::TempDir dir_;
  test::TempDir script_;
};

class BashCompletionTest : public Completion {
 protected:
  using Words = std::vector<std::string>;

  // The replies to each of several lines, by one bash: their words as bash splits them, the last of
  // them to be completed.
  std::vector<Words> CompleteAll(const std::vector<Words>& lines) const {
    std::string script = fmt::format("cd '{}'\nsource '{}'\n",
                                     dir_.path().string(),
                                     Write("completion", BashCompletion(AllCommands())));
    for (const Words& words : lines) {
      script += fmt::format(
          "COMPREPLY=() COMP_WORDS=('{}') COMP_CWORD={}\n"
          "_cohort\n"
          "printf '%s\\n' \"${{COMPREPLY[@]}}\" '{}'\n",
          fmt::join(words, "' '"),
          words.size() - 1,
          kEnd);
    }
    const test::ProgramEnd end = test::RunShell("bash --norc '" + Write("run.bash", script) + "'");
    EXPECT_EQ(end.exit_code, 0);
    EXPECT_EQ(end.err, "");
    return RepliesIn(end.out, lines.size());
  }

  Words Complete(const Words& words) const { return CompleteAll({words}).front(); }
};

TEST_F(BashCompletionTest, OffersTheCommands) {
  std::vector<std::string> names{"--help", "--version"};
  for (const Command& command : AllCommands()) names.push_back(command.name);
  EXPECT_THAT(Complete({"cohort", ""}), testing::UnorderedElementsAreArray(names));
  EXPECT_THAT(Complete({"cohort", "re"}), ElementsAre("reconstruct", "refine"));
  EXPECT_THAT(Complete({"cohort", "nothing", ""}), IsEmpty());
}

TEST_F(BashCompletionTest, OffersTheOptionsThatPeopleUseThenAll) {
  for (const Command& command : AllCommands()) {
    SCOPED_TRACE(command.name);
    std::vector<Words> lines{{"cohort", command.name, "--"}};
    std::vector<Tier> tiers;
    for (const OptionHelp& option : command.options) {
      if (option.IsPositional()) continue;
      const std::string& name = option.names.front();
      lines.push_back({"cohort",
                       command.name,
                       option.left.starts_with("--[no-]") ? "--no-" + name.substr(2) : name});
      tiers.push_back(option.tier);
    }
    const std::vector<Words> replies = CompleteAll(lines);
    const Words& common = replies.front();
    EXPECT_THAT(common, AllOf(Contains("--help"), Contains("--config"), Each(StartsWith("--"))));
    for (std::size_t i = 0; i < tiers.size(); ++i) {
      const std::string& given = lines[i + 1].back();
      EXPECT_EQ(std::count(common.begin(), common.end(), given), tiers[i] == Tier::kCommon)
          << given;
      EXPECT_THAT(replies[i + 1], Contains(given));
    }
  }
}

TEST_F(BashCompletionTest, OffersTheValuesOfAChoice) {
  EXPECT_THAT(Complete({"cohort", "track", "clip.mp4", "--tracker", ""}),
              IsSupersetOf({"subspace", "klt"}));
  EXPECT_THAT(Complete({"cohort", "reconstruct", "--backend", "c"}),
              ElementsAre("ceres", "colmap"));
  // As bash splits --backend=col.
  EXPECT_THAT(Complete({"cohort", "reconstruct", "--backend", "=", "col"}), ElementsAre("colmap"));
  EXPECT_THAT(Complete({"cohort", "reconstruct", "--backend", "="}),
              ElementsAre("ceres", "colmap"));
  EXPECT_THAT(Complete({"cohort", "track", "--features", ""}), IsEmpty());
}

TEST_F(BashCompletionTest, OffersFiles) {
  EXPECT_THAT(Complete({"cohort", "track", ""}), UnorderedElementsAre("a clip.mp4", "scenes"));
  EXPECT_THAT(Complete({"cohort", "track", "clip.mp4", "--mask", "a"}), ElementsAre("a clip.mp4"));
  EXPECT_THAT(Complete({"cohort", "track", "--config", "s"}), ElementsAre("scenes"));
}

// A line that is typed, with a tab at its end, in an interactive bash.
TEST_F(BashCompletionTest, WorksInALineThatIsTyped) {
  if (test::RunShell("command -v script").exit_code != 0) GTEST_SKIP() << "no script";
  const std::string typed =
      fmt::format("source {}; cd {}\\ncohort tra\\ta\\t\\001echo LINE: \\nexit\\n",
                  Write("completion", BashCompletion(AllCommands())),
                  dir_.path().string());
  const test::ProgramEnd end = test::RunShell(
      fmt::format("printf '{}' | TERM=dumb INPUTRC=/dev/null script -qc 'bash --norc -i' "
                  "/dev/null",
                  typed));
  EXPECT_THAT(end.out, testing::HasSubstr("LINE: cohort track a clip.mp4"));
}

TEST_F(Completion, OfFishOffersCommandsOptionsAndValues) {
  if (test::RunShell("command -v fish").exit_code != 0) GTEST_SKIP() << "no fish";
  const std::string script = Write("cohort.fish", FishCompletion(AllCommands()));
  // What it offers for each of several lines, by one fish.
  const auto complete = [&](const std::vector<std::string>& lines) {
    std::string text = fmt::format("source {}\n", script);
    for (const std::string& line : lines) {
      text += fmt::format("complete -C\"{}\"\necho '{}'\n", line, kEnd);
    }
    const test::ProgramEnd end = test::RunShell(
        fmt::format("cd '{0}' && PATH={1}:$PATH HOME={1} fish --no-config '{2}' | cut -f 1",
                    dir_.path().string(),
                    script_.path().string(),
                    Write("lines.fish", text)));
    EXPECT_EQ(end.err, "");
    return RepliesIn(end.out, lines.size());
  };
  const auto offers = complete({"cohort re",
                                "cohort track --",
                                "cohort reconstruct --backend c",
                                "cohort track --features ",
                                "cohort track --mask a",
                                "cohort track a"});
  EXPECT_THAT(offers[0], UnorderedElementsAre("reconstruct", "refine"));
  EXPECT_THAT(offers[1],
              AllOf(Contains("--features"), Contains("--help"), Not(Contains("--backend"))));
  EXPECT_THAT(offers[2], UnorderedElementsAre("ceres", "colmap"));
  EXPECT_THAT(offers[3], IsEmpty());
  EXPECT_THAT(offers[4], ElementsAre("a clip.mp4"));
  EXPECT_THAT(offers[5], ElementsAre("a clip.mp4"));

  std::vector<std::string> rare;  // an option of each command that is not offered at once
  std::vector<std::string> lines;
  for (const Command& command : AllCommands()) {
    for (const OptionHelp& option : command.options) {
      if (option.IsPositional() || option.left.starts_with("--[no-]")) continue;
      if (option.tier == Tier::kCommon) continue;
      rare.push_back(option.names.front());
      lines.push_back("cohort " + command.name + " --");
      lines.push_back("cohort " + command.name + " " + rare.back());
      break;
    }
  }
  const auto of_rare = complete(lines);
  for (std::size_t i = 0; i < rare.size(); ++i) {
    EXPECT_THAT(of_rare[2 * i], Not(Contains(rare[i]))) << lines[2 * i];
    EXPECT_THAT(of_rare[2 * i + 1], Contains(rare[i])) << lines[2 * i + 1];
  }
}

// Lines that are typed with a tab at their end, in an interactive zsh: each shows what it became.
TEST_F(Completion, OfZshCompletesLinesThatAreTyped) {
  if (test::RunShell("command -v zsh && command -v script").exit_code != 0) {
    GTEST_SKIP() << "no zsh";
  }
  Write("_cohort", ZshCompletion(AllCommands()));
  const std::vector<std::pair<std::string, std::string>> lines{
      {"cohort refi", "cohort refine"},
      {"cohort track --featu", "cohort track --features"},
      {"cohort track --klt.win", "cohort track --klt.window-px"},
      {"cohort track --tracker subs", "cohort track --tracker subspace"},
      {"cohort reconstruct --backend=col", "cohort reconstruct --backend=colmap"},
      {"cohort track --mask a", "cohort track --mask a clip.mp4"},
      {"cohort track sce", "cohort track scenes"}};
  std::string typed =
      fmt::format("fpath=({} $fpath); autoload -U compinit; compinit -u -D; cd {}\n",
                  script_.path().string(),
                  dir_.path().string());
  for (const auto& [begin, end] : lines) typed += begin + "\t\001echo LINE: \n";
  const std::string input = Write("typed", typed + "exit\n");
  const test::ProgramEnd end =
      test::RunShell(fmt::format("TERM=dumb script -qc 'zsh -f -i' /dev/null <'{}'", input));
  for (const auto& [begin, completed] : lines) {
    EXPECT_THAT(end.out, testing::HasSubstr("\nLINE: " + completed + "\r")) << begin;
  }
}

}  // namespace
}  // namespace cohort
