// Levels of the grid: which recipe at which level each of them is.
#include "pipelines/experiment/plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "frontend/core/error.h"
#include "frontend/storage/output.h"
#include "pipelines/experiment/cell_tasks.h"
#include "pipelines/experiment/named_trackers.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(DegradationOf, NamesOfLevelsAreRecipesAndTheirLevels) {
  for (const auto& [name, recipe, level, light] :
       {std::tuple("clean", DegradeRecipe::kPaper, 0.0, 1.0),
        std::tuple("1.5", DegradeRecipe::kPaper, 1.5, 1.0),
        std::tuple("hard", DegradeRecipe::kPaper, 2.0, 1.0),
        std::tuple("sensor", DegradeRecipe::kSensor, 2.0, 1.0),
        std::tuple("sensor-8th", DegradeRecipe::kSensor, 2.0, 0.125),
        std::tuple("phone", DegradeRecipe::kPhone, 2.0, 1.0),
        std::tuple("phone-medium", DegradeRecipe::kPhone, 1.0, 1.0)}) {
    Condition condition;
    condition.level = name;
    condition.seed = 7;
    const DegradeOptions degrade = DegradationOf(condition);
    EXPECT_EQ(degrade.recipe, recipe) << name;
    EXPECT_EQ(degrade.level, level) << name;
    EXPECT_EQ(degrade.light, light) << name;
    EXPECT_EQ(degrade.seed, 7u);
  }
}

TEST(PlanWithoutClips, TakesTheLevelsOfOtherRecipesAndNoUnknownOnes) {
  ExperimentOptions options;
  options.levels = {"as-is", "medium", "sensor", "phone", "phone-medium"};
  EXPECT_NO_THROW(PlanWithoutClips(options));
  options.levels = {"phone-dark"};
  EXPECT_THAT(
      [&] { PlanWithoutClips(options); },
      ThrowsMessage<UsageError>(
          AllOf(HasSubstr("'phone-dark'"), HasSubstr("clean"), HasSubstr("phone-medium, as-is"))));
}

TEST(PlanWithoutClips, OfTheProtocolPaperHasNoSecondPass) {
  ExperimentOptions options;
  options.protocol = Protocol::kPaper;
  options.trackers = {"klt", "subspace"};
  EXPECT_NO_THROW(PlanWithoutClips(options));
  for (const char* name : {"klt-refined", "subspace-online"}) {
    options.trackers = {"klt", name};
    EXPECT_THAT([&] { PlanWithoutClips(options); },
                ThrowsMessage<UsageError>(AllOf(HasSubstr(name), HasSubstr("second pass"))));
  }
  options.trackers = {"subspace"};
  options.second_pass.mode = SecondPassMode::kOn;
  EXPECT_THROW(PlanWithoutClips(options), UsageError);
}

TEST(ModelTask, OfColmapDependsOnTheOptionsOfCeresWhichHelpsIt) {
  const auto depends_on = [](const char* tracker, double readout) {
    ExperimentOptions options;
    options.ceres.readout = readout;
    TrackCell cell;
    cell.tracker = NamedGridTracker(tracker, {}, SecondPassMode::kAuto);
    return ModelTask(options, cell, GridBackend::kColmap).options;
  };
  EXPECT_EQ(depends_on("klt", 0.5), depends_on("klt", 0.5));
  EXPECT_NE(depends_on("klt", 0.5), depends_on("klt", 0.0));
  EXPECT_EQ(depends_on("sift", 0.5), depends_on("sift", 0.0)) << "it has no tracks for Ceres";
}

TEST(NamedGridTracker, OfAFileHasItsName) {
  const test::TempDir dir;
  WriteBytes(dir / "mine.json", R"({"tracker": "klt"})");
  const std::string file = dir / "mine.json";
  const GridTracker first = NamedGridTracker(file, {}, SecondPassMode::kOff);
  EXPECT_EQ(first.name, "mine");
  const GridTracker refined = NamedGridTracker(file + "-refined", {}, SecondPassMode::kOff);
  EXPECT_EQ(refined.name, "mine-refined");
  EXPECT_EQ(refined.second_pass, SecondPassMode::kOn);
  EXPECT_EQ(refined.options.tracker, TrackerKind::kKlt);
}

TEST(NamedGridTracker, OfAFileThatIsCalledAsAnotherIsRefused) {
  const test::TempDir dir;
  for (const char* name : {"klt", "klt31-refined", "subspace", "ceiling", "sift", "frames"}) {
    const std::string file = dir / (std::string(name) + ".json");
    WriteBytes(file, R"({"tracker": "klt"})");
    EXPECT_THAT([&] { NamedGridTracker(file, {}, SecondPassMode::kOff); },
                ThrowsMessage<UsageError>(HasSubstr("rename the file")))
        << name;
  }
}

TEST(IsPlainKlt, IsOfAnyWindowAndOnePass) {
  const auto is_plain = [](const char* name) {
    return IsPlainKlt(NamedGridTracker(name, {}, SecondPassMode::kAuto));
  };
  for (const char* name : {"klt", "klt21", "klt31"}) EXPECT_TRUE(is_plain(name)) << name;
  for (const char* name : {"klt31-refined", "anchored-klt21", "subspace", "ceiling"}) {
    EXPECT_FALSE(is_plain(name)) << name;
  }
}

}  // namespace
}  // namespace cohort
