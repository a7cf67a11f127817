#include "pipelines/report/results_tables.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <optional>
#include <sstream>

#include "tests/support/failing_results.h"

namespace cohort {
namespace {

using testing::StartsWith;

TEST(ResultsTables, ShowMediansOverSeedsAndNeverTheErrorOfAFailure) {
  EXPECT_EQ(ResultsTables(test::FailingResults()),
            "sequence  level  tracker   backend               registered     ATE\n"
            "                                                               [mm]\n"
            "-------------------------------------------------------------------\n"
            "room      hard   klt       ceres    FAILED 1 of 2, 57.5/100  failed\n"
            "room      hard   descent   ceres       FAILED 2 of 2, 3/100       -\n"
            "room      hard   subspace  ceres                     99/100    2.50\n"
            "\n"
            "sequence  level  tracker   length\n"
            "---------------------------------\n"
            "room      hard   klt         15.0\n"
            "room      hard   descent     15.0\n"
            "room      hard   subspace    15.0\n");
}

TEST(ResultsTables, HalvesThatFailedAreInfinitelyApart) {
  ExperimentResults results = test::FailingResults();
  const auto add = [&](const char* tracker, unsigned seed, std::optional<double> apart) {
    const auto row = [&](const char* metric, double value) {
      results.rows.push_back({"room", "hard", tracker, "ceres", seed, metric, value, ""});
    };
    row("halves_failed", !apart);
    if (apart) row("halves_disagreement", *apart);
  };
  add("klt", 1, 0.01);
  add("klt", 2, std::nullopt);
  add("subspace", 1, 0.01);
  add("subspace", 2, 0.04);
  EXPECT_THAT(
      ResultsTables(results),
      StartsWith("sequence  level  tracker   backend               registered     ATE  halves\n"
                 "                                                               [mm]     [%]\n"
                 "---------------------------------------------------------------------------\n"
                 "room      hard   klt       ceres    FAILED 1 of 2, 57.5/100  failed  failed\n"
                 "room      hard   descent   ceres       FAILED 2 of 2, 3/100       -       -\n"
                 "room      hard   subspace  ceres                     99/100    2.50    2.50\n"));
}

TEST(ResultsTables, AreNeverWiderThanThePage) {
  ExperimentResults results;
  for (const char* metric : {"failed",
                             "registered",
                             "frames",
                             "ate",
                             "ate_to_undegraded",
                             "halves_disagreement",
                             "halves_frames",
                             "rpe_rot",
                             "point_error_median",
                             "points",
                             "mean_reprojection"}) {
    results.rows.push_back({"rgbd_dataset_freiburg1_xyz",
                            "hard",
                            "klt31-refined",
                            "triangulation",
                            1,
                            metric,
                            1.0,
                            ""});
  }
  std::istringstream lines(ResultsTables(results));
  int tables = 0;
  for (std::string line; std::getline(lines, line);) {
    EXPECT_LE(line.size(), 120u);
    tables += line.starts_with("sequence");
  }
  EXPECT_GE(tables, 2);  // goes on below
}

}  // namespace
}  // namespace cohort
