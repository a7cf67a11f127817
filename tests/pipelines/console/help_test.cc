#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <nlohmann/json.hpp>
#include <sstream>

#include "pipelines/commands/all_commands.h"

namespace cohort {
namespace {

using testing::HasSubstr;
using Json = nlohmann::ordered_json;

std::string Printed(const Command& command, const std::string& flag) {
  testing::internal::CaptureStdout();
  EXPECT_EQ(command.run(std::vector<std::string>{flag}), 0);
  return testing::internal::GetCapturedStdout();
}

struct ListedOption {
  std::string names;
  std::string text;  // without the range and the default in brackets at its end
};

// The options that a help text lists: lines of two spaces, names, then the text, which goes on in
// lines of more spaces.
std::vector<ListedOption> ListedOptions(const std::string& help) {
  std::vector<ListedOption> options;
  std::istringstream lines(help);
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("  ")) continue;
    std::istringstream words(line);
    std::string word;
    if (line[2] != ' ') {
      words >> word;
      options.push_back({word, ""});
    }
    while (words >> word) {
      ListedOption& option = options.back();
      if (option.text.empty() && word.starts_with("--")) {
        option.names += " " + word;
      } else {
        option.text += (option.text.empty() ? "" : " ") + word;
      }
    }
  }
  for (ListedOption& option : options) {
    if (option.text.ends_with(')')) option.text.erase(option.text.rfind(" ("));
  }
  return options;
}

void ListPaths(const Json& json, const std::string& prefix, std::vector<std::string>& paths) {
  for (const auto& [key, value] : json.items()) {
    if (value.is_object()) {
      ListPaths(value, prefix + key + ".", paths);
    } else {
      paths.push_back(prefix + key);
    }
  }
}

TEST(Help, ShowsAtMostTwentyTwoOptionsEachInFullSentences) {
  for (const Command& command : AllCommands()) {
    SCOPED_TRACE(command.name);
    const std::vector<ListedOption> options = ListedOptions(Printed(command, "--help"));
    EXPECT_LE(options.size(), 22U);
    EXPECT_GE(options.size(), 6U);
    for (const ListedOption& option : options) {
      ASSERT_FALSE(option.text.empty()) << option.names;
      EXPECT_TRUE(std::isupper(option.text.front())) << option.names << ": " << option.text;
      EXPECT_EQ(option.text.back(), '.') << option.names << ": " << option.text;
    }
  }
}

TEST(Help, SaysHowManyOptionsItLeavesOut) {
  for (const Command& command : AllCommands()) {
    SCOPED_TRACE(command.name);
    const std::string common = Printed(command, "--help");
    const std::string all = Printed(command, "--help-all");
    const std::size_t others = ListedOptions(all).size() - ListedOptions(common).size();
    const std::string line =
        fmt::format("'cohort {} --help-all' lists the other {} too.", command.name, others);
    if (others > 0) {
      EXPECT_THAT(common, HasSubstr(line));
    } else {
      EXPECT_EQ(common, all);
    }
  }
}

TEST(Help, OfAllShowsEveryOptionThatACommandHas) {
  for (const Command& command : AllCommands()) {
    SCOPED_TRACE(command.name);
    std::string names = " ";
    for (const ListedOption& option : ListedOptions(Printed(command, "--help-all"))) {
      std::string name = option.names;
      for (const std::string_view dashes : {"--[no-]", "--", ","}) {
        for (std::size_t at; (at = name.find(dashes)) != std::string::npos;) {
          name.erase(at, dashes.size());
        }
      }
      std::replace(name.begin(), name.end(), '-', '_');
      names += name + " ";
    }
    std::vector<std::string> paths;
    ListPaths(Json::parse(Printed(command, "--dump-config")), "", paths);
    EXPECT_FALSE(paths.empty());
    for (const std::string& path : paths) EXPECT_THAT(names, HasSubstr(" " + path + " "));
  }
}

}  // namespace
}  // namespace cohort
