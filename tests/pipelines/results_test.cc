#include "pipelines/experiment/results.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "frontend/core/output.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

// klt fails with one of two seeds, subspace with none, descent with both.
ExperimentResults SomeResults() {
  ExperimentResults results;
  const auto add = [&](const char* tracker, unsigned seed, double registered, double ate_m) {
    const bool failed = registered < 80;
    const auto row = [&](const char* backend, const char* metric, double value, const char* unit) {
      results.rows.push_back({"room", "hard", tracker, backend, seed, metric, value, unit});
    };
    row("", "mean_track_length", 10.0 * seed, "frames");
    row("ceres", "failed", failed, "");
    row("ceres", "registered", registered, "frames");
    row("ceres", "frames", 100, "frames");
    if (failed) {
      results.failures.push_back({"room", "hard", tracker, "ceres", seed, "no start"});
    } else {
      row("ceres", "ate", ate_m, "m");
    }
  };
  add("klt", 1, 100, 0.010);
  add("klt", 2, 15, 0.0001);
  add("descent", 1, 2, 0.0001);
  add("descent", 2, 4, 0.0001);
  add("subspace", 1, 100, 0.002);
  add("subspace", 2, 98, 0.003);
  return results;
}

TEST(ResultsTable, ShowsMediansOverSeedsAndNeverTheErrorOfAFailure) {
  EXPECT_EQ(ResultsTable(SomeResults()),
            "sequence  level  tracker   backend             registered  ATE [mm]  length\n"
            "---------------------------------------------------------------------------\n"
            "room      hard   klt       ceres    FAILED 1 of 2, 58/100     10.00    15.0\n"
            "room      hard   descent   ceres     FAILED 2 of 2, 3/100         -    15.0\n"
            "room      hard   subspace  ceres                   99/100      2.50    15.0\n");
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
  WriteResultsJson(dir / "results.json", SomeResults(), {{"program", "cohort"}});
  const auto json = nlohmann::json::parse(ReadBytes(dir / "results.json"));
  EXPECT_EQ(json["conditions"]["program"], "cohort");
  EXPECT_EQ(json["failures"].size(), 3u);
  EXPECT_EQ(json["failures"][0]["reason"], "no start");
  EXPECT_EQ(json["rows"].size(), SomeResults().rows.size());
  EXPECT_EQ(json["rows"][1]["metric"], "failed");
}

}  // namespace
}  // namespace cohort
