#include "pipelines/json/option_list.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "frontend/storage/output.h"
#include "pipelines/console/command_line.h"
#include "pipelines/json/json_file.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;
using Json = nlohmann::ordered_json;

enum class Mode { kFast, kExact };
constexpr ChoiceNames<Mode, 2> kModeNames{{{"fast", Mode::kFast}, {"exact", Mode::kExact}}};

struct InnerOptions {
  int window_px = 21;
  double weight = 0.5;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Odd("window_px", o.window_px, 3, 101, "side of the patch [px]");
    v.Number("weight", o.weight, 0.0, 1.0, "of the penalty");
  }
};

struct OuterOptions {
  std::vector<std::string> inputs;
  std::string out;
  Mode mode = Mode::kFast;
  bool resume = false;
  bool check = true;
  unsigned seed = 0;
  InnerOptions left;
  InnerOptions right;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.List("inputs", o.inputs, "what to read");
    v.Text("out", o.out, "what to write");
    v.Choice("mode", o.mode, kModeNames, "how");
    v.Flag("resume", o.resume, "go on");
    v.Flag("check", o.check, "look twice");
    v.Number("seed", o.seed, 0U, 4294967295U, "of chance");
    v.Group("left", o.left, "left hand");
    v.Group("right", o.right, "right hand");
  }
};

const CommandLine kLine{.name = "do",
                        .usage = "INPUT... [options]",
                        .summary = "Does it",
                        .positionals = {"inputs"},
                        .required = {"inputs"},
                        .short_flags = {{"weight", {"left.weight"}},
                                        {"window", {"left.window_px", "right.window_px"}}}};

OuterOptions Parse(const std::vector<std::string>& arguments) {
  OuterOptions options;
  EXPECT_EQ(ParseCommandLine(kLine, ListOptions(options), arguments), ParseOutcome::kRun);
  return options;
}

TEST(CommandLine, SetsEveryKindOfOption) {
  const OuterOptions options = Parse({"a",
                                      "--out",
                                      "x",
                                      "b",
                                      "--mode=exact",
                                      "--resume",
                                      "--no-check",
                                      "--seed",
                                      "4294967295",
                                      "--left.window-px",
                                      "7",
                                      "--weight",
                                      "1e-2"});
  EXPECT_THAT(options.inputs, ElementsAre("a", "b"));
  EXPECT_EQ(options.out, "x");
  EXPECT_EQ(options.mode, Mode::kExact);
  EXPECT_TRUE(options.resume);
  EXPECT_FALSE(options.check);
  EXPECT_EQ(options.seed, 4294967295U);
  EXPECT_EQ(options.left.window_px, 7);
  EXPECT_EQ(options.left.weight, 0.01);
  EXPECT_EQ(options.right.window_px, 21);
}

TEST(CommandLine, AFlagOfSeveralOptionsGivesWayToTheOptionsOwn) {
  const OuterOptions options = Parse({"a", "--right.window-px", "9", "--window", "31"});
  EXPECT_EQ(options.left.window_px, 31);
  EXPECT_EQ(options.right.window_px, 9);
}

TEST(CommandLine, TheLastOfTwoCounts) { EXPECT_EQ(Parse({"a", "--seed=1", "--seed=2"}).seed, 2U); }

void ExpectUsageError(const std::vector<std::string>& arguments,
                      const testing::Matcher<std::string>& message) {
  EXPECT_THAT([&] { Parse(arguments); }, ThrowsMessage<UsageError>(message));
}

TEST(CommandLine, NamesWhatIsWrong) {
  ExpectUsageError({}, HasSubstr("inputs is missing: usage is cohort do INPUT..."));
  ExpectUsageError({"a", "--wieght", "1"},
                   AllOf(HasSubstr("unknown option --wieght"), HasSubstr("--weight?")));
  ExpectUsageError({"a", "--zzzzzz=3"},
                   HasSubstr("unknown option --zzzzzz: 'cohort do --help-all'"));
  ExpectUsageError({"a", "--seed", "3.5"}, HasSubstr("--seed '3.5' is not a whole number"));
  ExpectUsageError({"a", "--seed", "-1"}, HasSubstr("--seed -1 is out of range: give 0 to"));
  ExpectUsageError({"a", "--weight", "nan"}, HasSubstr("--weight nan is out of range"));
  ExpectUsageError({"a", "--weight", "2"}, HasSubstr("--weight 2 is out of range: give 0 to 1"));
  ExpectUsageError({"a", "--window", "20"},
                   HasSubstr("--window 20 is even: give an odd number from 3 to 101"));
  ExpectUsageError({"a", "--window", "x"}, HasSubstr("--window 'x' is not a whole number"));
  ExpectUsageError({"a", "--mode", "slow"},
                   HasSubstr("--mode 'slow' is unknown: give one of fast"));
  ExpectUsageError({"a", "--out"}, HasSubstr("--out"));
}

TEST(OptionsJson, WhatIsDumpedReadsBackTheSame) {
  OuterOptions options =
      Parse({"a", "b", "--mode", "exact", "--no-check", "--right.weight", "0.1"});
  const Json json = ToJson(options);
  EXPECT_EQ(json["right"]["weight"], 0.1);
  EXPECT_EQ(json["inputs"], Json({"a", "b"}));
  OuterOptions again;
  SetFromJson(ListOptions(again), json, "c.json");
  EXPECT_EQ(ToJson(again), json);
}

TEST(OptionsJson, SetsOnlyWhatItNames) {
  OuterOptions options;
  options.out = "x";
  SetFromJson(ListOptions(options), Json::parse(R"({"left": {"weight": 1}})"), "c.json");
  EXPECT_EQ(options.left.weight, 1.0);
  EXPECT_EQ(options.left.window_px, 21);
  EXPECT_EQ(options.out, "x");
}

TEST(ReadJsonFile, NamesTheFileThatIsNoJson) {
  const test::TempDir dir;
  for (const char* text : {"", "{", "{\"a\": 1e999}", "88e8888888888", "[1, nan]", "\"\xff\""}) {
    WriteBytes(dir / "a.json", text);
    EXPECT_THAT([&] { ReadJsonFile(dir / "a.json"); },
                ThrowsMessage<Error>(AllOf(HasSubstr("a.json"), HasSubstr("is not valid JSON"))))
        << text;
  }
}

TEST(ReadJsonFile, NestedWithoutEndIsAnError) {
  const test::TempDir dir;
  const auto too_deep =
      ThrowsMessage<Error>(AllOf(HasSubstr("a.json"), HasSubstr("more than 100 levels deep")));
  WriteBytes(dir / "a.json", std::string(1'000'000, '['));
  EXPECT_THAT([&] { ReadJsonFile(dir / "a.json"); }, too_deep);
  WriteBytes(dir / "a.json", std::string(101, '[') + std::string(101, ']'));
  EXPECT_THAT([&] { ReadJsonFile(dir / "a.json"); }, too_deep);
  WriteBytes(dir / "a.json", std::string(100, '[') + std::string(100, ']'));
  EXPECT_TRUE(ReadJsonFile(dir / "a.json").is_array());
  std::filesystem::resize_file(dir / "a.json", std::uintmax_t{1} << 40);
  EXPECT_THAT([&] { ReadJsonFile(dir / "a.json"); }, ThrowsMessage<Error>(HasSubstr("bytes")));
}

// What finds keys one by one, or looks through a list for each of its objects, would take hours.
TEST(ReadJsonFile, ManyKeysAndManyObjectsTakeNoHours) {
  const test::TempDir dir;
  std::string text = "[{}";
  for (int i = 1; i < 1'000'000; ++i) text += ",{}";
  WriteBytes(dir / "a.json", text + "]");
  EXPECT_EQ(ReadJsonFile(dir / "a.json").size(), 1'000'000u);

  text = R"({"0":0)";
  for (int i = 1; i < 1'000'000; ++i) text += fmt::format(R"(,"{}":0)", i);
  WriteBytes(dir / "a.json", text + "}");
  EXPECT_THAT([&] { ReadJsonFile(dir / "a.json"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("a.json"), HasSubstr("too many keys"))));
}

TEST(ReadJsonFile, AKeyThatStandsTwiceIsAnError) {
  const test::TempDir dir;
  WriteBytes(dir / "a.json", R"({"left": {"a": 1}, "b": [{"a": 2}, {"a": 3}], "left": {"c": 4}})");
  EXPECT_THAT([&] { ReadJsonFile(dir / "a.json"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("a.json"), HasSubstr("\"left\" occurs twice"))));
  WriteBytes(dir / "a.json", R"({"left": {"a": 1}, "b": [{"a": 2}, {"a": 3}], "a": {"left": 4}})");
  EXPECT_EQ(ReadJsonFile(dir / "a.json").size(), 3);
}

TEST(UseJsonFile, NamesTheFileThatIsOfAnotherKind) {
  const test::TempDir dir;
  for (const char* text : {"7", "[]", "{}", "{\"frames\": \"many\"}", "{\"frames\": null}"}) {
    WriteBytes(dir / "a.json", text);
    EXPECT_THAT(
        [&] { UseJsonFile(dir / "a.json", [](const Json& j) { j.at("frames").get<int>(); }); },
        ThrowsMessage<Error>(
            AllOf(HasSubstr("a.json"), HasSubstr("not have the form that cohort writes"))))
        << text;
  }
}

TEST(WriteJsonFile, HoldsNamesThatAreNoText) {
  const test::TempDir dir;
  WriteJsonFile(dir / "a.json", {{"name", "a\xff.png"}});
  EXPECT_EQ(ReadJsonFile(dir / "a.json").at("name"), "a\xef\xbf\xbd.png");
}

TEST(OptionsJson, NamesTheKeyThatIsWrong) {
  const auto set = [](const char* text) {
    OuterOptions options;
    SetFromJson(ListOptions(options), Json::parse(text), "c.json");
  };
  const auto throws = [](const char* text) { return ThrowsMessage<UsageError>(HasSubstr(text)); };
  EXPECT_THAT([&] { set(R"({"left": {"wait": 1}})"); }, throws("c.json: unknown key left.wait"));
  EXPECT_THAT([&] { set(R"({"lift": {}})"); }, throws("unknown key lift"));
  EXPECT_THAT([&] { set(R"({"left": 3})"); }, throws("key left must be an object"));
  EXPECT_THAT([&] { set(R"({"left": null})"); }, throws("key left must be an object"));
  EXPECT_THAT([&] { set(R"({"seed": 1.5})"); }, throws("key seed must be a whole number"));
  EXPECT_THAT([&] { set(R"({"check": "yes"})"); }, throws("key check must be true or false"));
  EXPECT_THAT([&] { set(R"({"inputs": "a"})"); }, throws("key inputs must be a list of texts"));
  EXPECT_THAT([&] { set(R"({"left": {"weight": 7}})"); },
              throws("c.json: key left.weight = 7 is out of range: give 0 to 1"));
  EXPECT_THAT([&] { set(R"({"right": {"window_px": 6}})"); },
              throws("c.json: key right.window_px = 6 is even: give an odd number from 3 to 101"));
  EXPECT_THAT([&] { set("[1]"); }, throws("must hold one JSON object"));
}

}  // namespace
}  // namespace cohort
