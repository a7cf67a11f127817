#include "pipelines/sfm/summary_json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <nlohmann/json.hpp>

#include "frontend/storage/input_file.h"
#include "tests/support/source_dir.h"

namespace cohort {
namespace {

using Json = nlohmann::ordered_json;
using testing::ElementsAre;

TEST(DoubtsToJson, IsReadAgainAsItWas) {
  const std::vector<Doubt> doubts{
      {DoubtCode::kExcessNoise, "noise: check", {{"noise_left_px", 1.5}, {"noise_px", 0.25}}},
      {DoubtCode::kOnlyTurns, "turns: walk"}};
  EXPECT_EQ(DoubtsToJson(doubts), Json::parse(R"([
      {"code": "excess-noise", "sentence": "noise: check",
       "figures": {"noise_left_px": 1.5, "noise_px": 0.25}},
      {"code": "only-turns", "sentence": "turns: walk", "figures": {}}])"));
  EXPECT_EQ(DoubtsFromJson(Json::parse(DoubtsToJson(doubts).dump())), doubts);
  EXPECT_EQ(DoubtsToJson({}).dump(), "[]");
}

TEST(DoubtsToJson, LeavesOutAFigureThatJsonCannotHold) {
  const Doubt doubt{DoubtCode::kWeakDepth,
                    "depths are unknown",
                    {{"depth_uncertainty", std::numeric_limits<double>::infinity()}}};
  EXPECT_EQ(DoubtsToJson({doubt})[0]["figures"], Json::object());
}

TEST(DoubtsFromJson, ReadsACodeOfAnotherVersion) {
  const Json json =
      Json::parse(R"([{"code": "of-tomorrow", "sentence": "new", "figures": {"a": 1}}])");
  EXPECT_THAT(DoubtsFromJson(json), ElementsAre(Doubt{DoubtCode::kOther, "new", {{"a", 1.0}}}));
}

TEST(DoubtsFromJson, ThrowsOnWhatIsNoListOfReasons) {
  for (const char* text : {"5",
                           "\"text\"",
                           "{}",
                           "[5]",
                           "[{}]",
                           R"([{"code": "parts", "sentence": "s"}])",
                           R"([{"code": "parts", "sentence": "s", "figures": [1]}])",
                           R"([{"code": "parts", "sentence": "s", "figures": {"a": "b"}}])"}) {
    EXPECT_THROW(DoubtsFromJson(Json::parse(text)), Json::exception) << text;
  }
}

TEST(DoubtCodes, AreAllInTheDocument) {
  const std::string page = ReadBytes(test::SourceDir() / "docs" / "files.md");
  for (const auto& [name, code] : kDoubtCodeNames) {
    EXPECT_THAT(page, testing::HasSubstr("| `" + std::string(name) + "` |"));
  }
}

}  // namespace
}  // namespace cohort
