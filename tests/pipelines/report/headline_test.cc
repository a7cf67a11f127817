// Who won, and by how much: in the reader's favour, never in the tracker's.
#include "pipelines/report/headline.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cohort {
namespace {

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
  ASSERT_EQ(headline->rows.size(), 1u);
  const HeadlineRow& row = headline->rows[0];
  ASSERT_TRUE(row.camera_klt);
  EXPECT_NEAR(row.camera_klt->value, 4.0, 1e-12);  // the geometric mean of 2 and 8
  EXPECT_EQ(row.camera_klt->clips, 2u);
  EXPECT_FALSE(row.camera_anchored);
  EXPECT_EQ(*row.registered, 1.0);
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
  ASSERT_TRUE(headline && headline->rows[0].camera_klt);
  EXPECT_NEAR(headline->rows[0].camera_klt->value, 2.0, 1e-12);
  EXPECT_NEAR(headline->rows[0].camera_klt->least, 1.0, 1e-12);
  EXPECT_NEAR(headline->rows[0].camera_klt->largest, 9.0, 1e-12);
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
  const HeadlineRow& row = headline->rows[0];
  EXPECT_EQ(row.clips, 2u);
  EXPECT_EQ(row.failed_klt, 1u);
  EXPECT_EQ(row.failed, 0u);
  EXPECT_EQ(row.camera_klt->clips, 1u);
  EXPECT_NEAR(row.camera_klt->value, 3.0, 1e-12);
  EXPECT_THAT(HeadlineTable(*headline), HasSubstr("3.00 of 1"));
  EXPECT_LT(*row.registered_klt, 0.75);
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
  const HeadlineRow& row = headline->rows[0];
  EXPECT_EQ(row.failed, 1u);
  EXPECT_EQ(row.camera_klt->clips, 1u);
  EXPECT_NEAR(row.camera_klt->value, 2.0, 1e-12);  // 4 over 2
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
  EXPECT_EQ(headline->rows[0].failed, 1u);
}

TEST_F(HeadlineOf, TheCeilingAndOtherTrackersAreNoRivals) {
  Add("a", "klt", 1, 4.0);
  Add("a", "ceiling", 1, 1.0);
  Add("a", "klt-of-mine", 1, 0.5);
  Add("a", "subspace", 1, 2.0);
  const auto headline = MakeHeadline(results_);
  ASSERT_TRUE(headline);
  EXPECT_TRUE(headline->losses.empty());
  EXPECT_NEAR(headline->rows[0].camera_klt->value, 2.0, 1e-12);
  EXPECT_NEAR(headline->rows[0].camera_ceiling->value, 2.0, 1e-12);
  EXPECT_THAT(HeadlineTable(*headline), HasSubstr("0/0/0"));
}

TEST_F(HeadlineOf, KltWithASecondPassIsARivalOfItsOwn) {
  Add("a", "klt21", 1, 4.0);
  Add("a", "klt21-refined", 1, 3.0);
  Add("a", "klt31-refined", 1, 1.0);
  Add("a", "subspace", 1, 2.0);
  const auto headline = MakeHeadline(results_);
  ASSERT_TRUE(headline);
  EXPECT_NEAR(headline->rows[0].camera_klt->value, 2.0, 1e-12);
  EXPECT_NEAR(headline->rows[0].camera_refined->value, 0.5, 1e-12);
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
  ASSERT_EQ(headline->rows[0].others.size(), 1u);
  const OtherTracker& descent = headline->rows[0].others[0];
  EXPECT_EQ(descent.name, "descent");
  EXPECT_NEAR(descent.camera->value, 3.0, 1e-12);
  EXPECT_EQ(descent.failed, 1u);
  EXPECT_NEAR(*descent.registered, 0.55, 1e-12);
  EXPECT_THAT(OthersTable(*headline), HasSubstr("3.00 of 1"));
}

TEST_F(HeadlineOf, ThereIsNoneWithoutARivalOrTruth) {
  Add("a", "subspace", 1, 2.0);
  EXPECT_FALSE(MakeHeadline(results_));
}

}  // namespace
}  // namespace cohort
