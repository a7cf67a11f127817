// Who won, and by how much: in the reader's favour, never in the tracker's.
#include "pipelines/report/headline.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "pipelines/report/headline_output.h"

namespace cohort {
namespace {

using testing::AllOf;
using testing::HasSubstr;

class HeadlineOf : public testing::Test {
 protected:
  void Add(const std::string& sequence,
           const std::string& tracker,
           unsigned seed,
           double ate,
           const std::string& backend = "ceres") {
    const auto row = [&](const char* metric, double value) {
      results_.rows.push_back({sequence, "medium", tracker, backend, seed, metric, value, ""});
    };
    row("failed", 0.0);
    row("registered", 50.0);
    row("frames", 50.0);
    row("ate", ate);
  }
  void AddFailure(const std::string& sequence, const std::string& tracker, unsigned seed) {
    const auto row = [&](const char* metric, double value) {
      results_.rows.push_back({sequence, "medium", tracker, "ceres", seed, metric, value, ""});
    };
    row("failed", 1.0);
    row("registered", 5.0);
    row("frames", 50.0);
  }

  ExperimentResults results_;
};

// Of the camera error through ceres at level medium; the test fails where there is none.
HeadlineRatio CameraRatio(const Headline& headline, const std::string& rival) {
  const HeadlineRatio* const ratio = headline.Ratio("medium", "ceres", "ate", rival);
  EXPECT_NE(ratio, nullptr) << rival;
  return ratio == nullptr ? HeadlineRatio{} : *ratio;
}
HeadlineRuns RunsBy(const Headline& headline, const std::string& tracker) {
  const HeadlineRuns* const runs = headline.Runs("medium", "ceres", tracker);
  EXPECT_NE(runs, nullptr) << tracker;
  return runs == nullptr ? HeadlineRuns{} : *runs;
}

TEST_F(HeadlineOf, TheBestKltOfEachClipIsTheRival) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    Add("a", "klt21", seed, 4.0);
    Add("a", "klt31", seed, 8.0);
    Add("a", "subspace", seed, 2.0);  // twice better than klt21
    Add("b", "klt21", seed, 100.0);
    Add("b", "klt31", seed, 16.0);
    Add("b", "subspace", seed, 2.0);  // eight times better than klt31
  }
  const auto headline = MakeHeadline(results_);
  ASSERT_TRUE(headline);
  EXPECT_EQ(headline->cohort, "subspace");
  ASSERT_EQ(headline->rows.size(), 1u);  // no points, no length, no other rival
  EXPECT_NEAR(CameraRatio(*headline, "KLT").value, 4.0, 1e-12);  // geometric mean of 2 and 8
  EXPECT_EQ(CameraRatio(*headline, "KLT").clips, 2u);
  EXPECT_EQ(RunsBy(*headline, "subspace").registered, 1.0);
  EXPECT_TRUE(headline->losses.empty());
  EXPECT_EQ(headline->contests, 2u);
}

TEST_F(HeadlineOf, SeedsAreMediansWithTheirRange) {
  const double klt[] = {1.0, 2.0, 9.0};
  for (const unsigned seed : {1U, 2U, 3U}) {
    Add("a", "klt", seed, klt[seed - 1]);
    Add("a", "subspace", seed, 1.0);
  }
  const auto headline = MakeHeadline(results_);
  ASSERT_TRUE(headline);
  EXPECT_NEAR(CameraRatio(*headline, "KLT").value, 2.0, 1e-12);
  EXPECT_NEAR(CameraRatio(*headline, "KLT").least, 1.0, 1e-12);
  EXPECT_NEAR(CameraRatio(*headline, "KLT").largest, 9.0, 1e-12);
}

TEST_F(HeadlineOf, AFailureIsCountedAndNeverASmallError) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    if (seed < 3) AddFailure("a", "klt", seed);  // most seeds: the third does not save it
    if (seed == 3) Add("a", "klt", seed, 0.001);
    Add("a", "subspace", seed, 1.0);
    Add("b", "klt", seed, 3.0);
    Add("b", "subspace", seed, 1.0);
  }
  const auto headline = MakeHeadline(results_);
  ASSERT_TRUE(headline);
  EXPECT_EQ(RunsBy(*headline, "subspace").clips, 2u);
  EXPECT_EQ(RunsBy(*headline, "subspace").failed, 0u);
  EXPECT_EQ(RunsBy(*headline, "KLT").failed, 1u);
  EXPECT_LT(RunsBy(*headline, "KLT").registered, 0.75);
  EXPECT_EQ(CameraRatio(*headline, "KLT").clips, 1u);
  EXPECT_NEAR(CameraRatio(*headline, "KLT").value, 3.0, 1e-12);
  EXPECT_THAT(HeadlineTables(*headline), AllOf(HasSubstr("3.00 of 1"), HasSubstr("0/1 of 2")));
}

TEST_F(HeadlineOf, AFailedSeedIsAnInfiniteErrorInTheMedian) {
  for (const unsigned seed : {1U, 2U, 3U}) {
    Add("a", "klt", seed, 2.0 * seed);  // 2, 4, 6
    if (seed < 3) Add("a", "subspace", seed, seed);
    if (seed == 3) AddFailure("a", "subspace", seed);  // 1, 2, infinite
    if (seed == 3) continue;                           // of two seeds one fails
    Add("b", "klt", seed, 3.0);
    if (seed == 1) Add("b", "subspace", seed, 1.0);
    if (seed == 2) AddFailure("b", "subspace", seed);
  }
  const auto headline = MakeHeadline(results_);
  ASSERT_TRUE(headline);
  EXPECT_EQ(RunsBy(*headline, "subspace").failed, 1u);
  EXPECT_EQ(CameraRatio(*headline, "KLT").clips, 1u);
  EXPECT_NEAR(CameraRatio(*headline, "KLT").value, 2.0, 1e-12);  // 4 over 2
  ASSERT_EQ(headline->losses.size(), 1u);
  EXPECT_EQ(headline->losses[0].sequence, "b");
}

TEST_F(HeadlineOf, WhereTheCohortDoesNotWinIsListed) {
  Add("a", "klt", 1, 4.0);
  Add("a", "anchored-klt21", 1, 1.0);
  Add("a", "subspace", 1, 2.0);  // better than KLT, not than anchored KLT
  Add("b", "klt", 1, 3.0);
  AddFailure("b", "subspace", 1);
  const auto headline = MakeHeadline(results_);
  ASSERT_TRUE(headline);
  ASSERT_EQ(headline->losses.size(), 2u);
  EXPECT_EQ(headline->losses[0].rival, "anchored-klt21");
  EXPECT_EQ(headline->losses[0].cohort, 2.0);
  EXPECT_EQ(headline->losses[1].sequence, "b");
  EXPECT_FALSE(headline->losses[1].cohort);
  EXPECT_EQ(RunsBy(*headline, "subspace").failed, 1u);
}

TEST_F(HeadlineOf, TheCeilingAndOtherTrackersAreNoRivals) {
  Add("a", "klt", 1, 4.0);
  Add("a", "ceiling", 1, 1.0);
  Add("a", "klt-of-mine", 1, 0.5);
  Add("a", "subspace", 1, 2.0);
  const auto headline = MakeHeadline(results_);
  ASSERT_TRUE(headline);
  EXPECT_TRUE(headline->losses.empty());
  EXPECT_NEAR(CameraRatio(*headline, "KLT").value, 2.0, 1e-12);
  EXPECT_NEAR(CameraRatio(*headline, "ceiling").value, 2.0, 1e-12);  // how many times worse
  EXPECT_NEAR(CameraRatio(*headline, "klt-of-mine").value, 0.25, 1e-12);
}

TEST_F(HeadlineOf, KltWithASecondPassIsARivalOfItsOwn) {
  Add("a", "klt21", 1, 4.0);
  Add("a", "klt21-refined", 1, 3.0);
  Add("a", "klt31-refined", 1, 1.0);
  Add("a", "subspace", 1, 2.0);
  const auto headline = MakeHeadline(results_);
  ASSERT_TRUE(headline);
  EXPECT_NEAR(CameraRatio(*headline, "KLT").value, 2.0, 1e-12);
  EXPECT_NEAR(CameraRatio(*headline, "KLT refined").value, 0.5, 1e-12);
  ASSERT_EQ(headline->losses.size(), 1u);
  EXPECT_EQ(headline->losses[0].rival, "klt31-refined");
}

TEST_F(HeadlineOf, OtherTrackersStandBesideTheCohort) {
  Add("a", "klt", 1, 4.0);
  Add("a", "descent", 1, 6.0);
  Add("a", "subspace", 1, 2.0);
  Add("b", "klt", 1, 4.0);
  AddFailure("b", "descent", 1);
  Add("b", "subspace", 1, 2.0);
  const auto headline = MakeHeadline(results_);
  ASSERT_TRUE(headline);
  EXPECT_NEAR(CameraRatio(*headline, "descent").value, 3.0, 1e-12);
  EXPECT_EQ(RunsBy(*headline, "descent").failed, 1u);
  EXPECT_NEAR(RunsBy(*headline, "descent").registered, 0.55, 1e-12);
  EXPECT_TRUE(headline->losses.empty());
  EXPECT_THAT(HeadlineTables(*headline), HasSubstr("3.00 of 1"));
}

TEST_F(HeadlineOf, JsonHasEveryRow) {
  Add("a", "klt", 1, 4.0);
  Add("a", "descent", 1, 6.0);
  Add("a", "subspace", 1, 2.0);
  const auto headline = MakeHeadline(results_);
  ASSERT_TRUE(headline);
  const auto json = HeadlineToJson(*headline);
  EXPECT_EQ(json["cohort"], "subspace");
  EXPECT_EQ(json["rivals"][0], nlohmann::ordered_json({{"name", "KLT"}, {"role", "contender"}}));
  ASSERT_EQ(json["rows"].size(), 2u);
  EXPECT_EQ(json["rows"][1]["rival"], "descent");
  EXPECT_EQ(json["rows"][1]["metric"], "ate");
  EXPECT_NEAR(json["rows"][1]["ratio"].get<double>(), 3.0, 1e-12);
  EXPECT_EQ(json["runs"].size(), 3u);
}

TEST_F(HeadlineOf, TablesAreNeverWiderThanThePage) {
  for (const char* sequence : {"a", "b"}) {
    for (const char* tracker : {"klt", "klt31-refined", "anchored-klt", "subspace-paper"}) {
      for (const unsigned seed : {1U, 2U, 3U}) {
        Add(sequence, tracker, seed, 1234.5 * seed, "triangulation");
        for (const char* metric : {"point_error_median", "mean_track_length"}) {
          results_.rows.push_back(
              {sequence, "medium", tracker, "triangulation", seed, metric, 99.94 * seed, ""});
        }
      }
    }
    for (const unsigned seed : {1U, 2U, 3U}) {
      Add(sequence, "subspace", seed, 3.0 - 0.1 * seed, "triangulation");
    }
  }
  const auto headline = MakeHeadline(results_);
  ASSERT_TRUE(headline);
  std::istringstream lines(HeadlineTables(*headline));
  int levels = 0;
  for (std::string line; std::getline(lines, line);) {
    EXPECT_LE(line.size(), 120u) << line;
    levels += line.starts_with("medium");
  }
  EXPECT_EQ(levels, 4);
}

TEST_F(HeadlineOf, ThereIsNoneWithoutARivalOrTruth) {
  Add("a", "subspace", 1, 2.0);
  EXPECT_FALSE(MakeHeadline(results_));
}

}  // namespace
}  // namespace cohort
