#include "pipelines/experiment/results.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <optional>

#include "frontend/storage/output.h"
#include "pipelines/experiment/cell_rows.h"
#include "tests/support/failing_results.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

TEST(HalvesRows, AHalfThatFailsIsARecordedFailureAndNoFigure) {
  using Json = nlohmann::ordered_json;
  const Json whole{{"error", nullptr}, {"figures", {{"model", {{"failed", false}}}}}};
  const auto rows_of = [](const Json& model, const Json& halves) {
    ExperimentResults results;
    AddHalvesRows(TrackCell(), GridBackend::kCeres, model, halves, results);
    return results;
  };
  const Json good{{"failed", false}};
  const Json bad{
      {"failed", true}, {"registered", 3}, {"frames", 60}, {"termination", "no more views"}};
  const auto halves_of = [&](const Json& second, const Json& disagreement) -> Json {
    return {{"error", nullptr},
            {"figures",
             {{"models", Json::array({good, second})},
              {"frames_share", 0.05},
              {"disagreement", disagreement}}}};
  };
  const ExperimentResults agreed = rows_of(whole, halves_of(good, 0.02));
  ASSERT_EQ(agreed.rows.size(), 3u);
  EXPECT_EQ(agreed.rows[0].value, 0.0);
  EXPECT_EQ(agreed.rows[1].metric, "halves_disagreement");
  EXPECT_EQ(agreed.rows[1].value, 0.02);
  EXPECT_TRUE(agreed.failures.empty());

  const auto expect_failure = [](const ExperimentResults& results, const std::string& reason) {
    ASSERT_FALSE(results.rows.empty());
    EXPECT_EQ(results.rows[0].metric, "halves_failed");
    EXPECT_EQ(results.rows[0].value, 1.0);
    for (const ResultRow& row : results.rows) EXPECT_NE(row.metric, "halves_disagreement");
    ASSERT_EQ(results.failures.size(), 1u);
    EXPECT_EQ(results.failures[0].reason, reason);
  };
  expect_failure(rows_of(whole, halves_of(bad, nullptr)),
                 "halves: 3 of 60 frames registered: no more views");
  expect_failure(rows_of(whole, halves_of(good, nullptr)),
                 "halves: their cameras do not determine an alignment");
  expect_failure(rows_of(whole, {{"error", "killed by signal 9"}, {"figures", nullptr}}),
                 "halves: killed by signal 9");

  // The reason for this is noted with the model.
  const ExperimentResults none = rows_of({{"error", "killed"}, {"figures", nullptr}}, nullptr);
  ASSERT_EQ(none.rows.size(), 1u);
  EXPECT_EQ(none.rows[0].metric, "halves_failed");
  EXPECT_TRUE(none.failures.empty());
}

TEST(ResultsCsv, IsTidy) {
  const test::TempDir dir;
  ExperimentResults results;
  results.rows.push_back({"a, b", "0.5", "klt", "ceres", 3, "ate", 0.0025, "m"});
  WriteResultsCsv(dir / "results.csv", results);
  EXPECT_EQ(ReadBytes(dir / "results.csv"),
            "sequence,level,tracker,backend,seed,metric,value,unit\n"
            "\"a, b\",0.5,klt,ceres,3,ate,0.0025,m\n");
}

TEST(ResultsJson, HoldsRowsFailuresAndConditions) {
  const test::TempDir dir;
  WriteResultsJson(dir / "results.json",
                   test::FailingResults(),
                   {{"program", "cohort"}},
                   {{"cohort", "subspace"}});
  const auto json = nlohmann::json::parse(ReadBytes(dir / "results.json"));
  EXPECT_EQ(json["conditions"]["program"], "cohort");
  EXPECT_EQ(json["headline"]["cohort"], "subspace");
  EXPECT_EQ(json["failures"].size(), 3u);
  EXPECT_EQ(json["failures"][0]["reason"], "no start");
  EXPECT_EQ(json["rows"].size(), test::FailingResults().rows.size());
  EXPECT_EQ(json["rows"][1]["metric"], "failed");
}

}  // namespace
}  // namespace cohort
