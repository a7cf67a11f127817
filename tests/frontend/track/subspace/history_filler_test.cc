#include "frontend/track/subspace/history_filler.h"

#include <gtest/gtest.h>

#include "tests/frontend/track/moving_picture.h"

namespace cohort {
namespace {

constexpr int kFrames = 6;
const Eigen::Vector2d kMotion(2.3, 1.1);  // [px] a frame
const Eigen::Vector2d kBorn(120, 90);

// The picture moves; a feature is born in the newest one.
struct Window {
  HistoryFiller filler{PatchOptions{}};
  AnchorPatch anchor;

  Window() {
    for (int t = 0; t < kFrames; ++t) {
      Pyramid picture = SmoothPyramid(test::ShiftedNoise(t * kMotion), 0.0);
      if (t == 0) {
        filler.Begin(picture);
      } else {
        filler.Remember(picture, kFrames);
      }
    }
    anchor = TakeAnchor(filler.newest(), kBorn, 21, 31);
  }

  FilledHistory Fill(const History& others) const {
    return filler.Fill(kBorn, anchor, others, CovarianceCalibration{});
  }
};

// The newest first. Every second feature moves by `other` in place of the picture's motion.
History OthersThatMove(const Eigen::Vector2d& other) {
  History history;
  for (int l = 0; l < kFrames; ++l) {
    Eigen::Matrix2Xd x = test::GridOfTwenty();
    for (int f = 0; f < 20; ++f) x.col(f) -= l * (f % 2 == 0 ? kMotion : other);
    history.push_back(x);
  }
  return history;
}

int CountMeasured(const FilledHistory& past) {
  int measured = 0;
  for (const auto& o : past.measured) measured += o.information.trace() > 0.0 ? 1 : 0;
  return measured;
}

TEST(HistoryFiller, ANewFeatureWasWhereThePictureShowsItBefore) {
  // The neighbours are wrong by half a pixel a frame: the image corrects them.
  const FilledHistory past = Window().Fill(OthersThatMove(kMotion + Eigen::Vector2d(1, 0)));
  ASSERT_EQ(past.xy.size(), static_cast<std::size_t>(kFrames));
  ASSERT_EQ(past.measured.size(), past.xy.size());
  EXPECT_TRUE(past.measured[0].anchor);
  for (int l = 0; l < kFrames; ++l) {
    EXPECT_LT((past.xy[static_cast<std::size_t>(l)] - (kBorn - l * kMotion)).norm(), 0.05) << l;
  }
  EXPECT_EQ(CountMeasured(past), kFrames);
}

TEST(HistoryFiller, FollowsNeighboursWithoutMeasuringWhereTheyDoNotMoveAlike) {
  const Eigen::Vector2d other(-6, 1.1);
  const FilledHistory past = Window().Fill(OthersThatMove(other));
  EXPECT_EQ(CountMeasured(past), 1);  // its birth
  for (std::size_t l = 1; l < past.xy.size(); ++l) {
    const Eigen::Vector2d motion = past.xy[l - 1] - past.xy[l];
    EXPECT_GT(motion.x(), other.x());
    EXPECT_LT(motion.x(), kMotion.x());
    EXPECT_NEAR(motion.y(), 1.1, 1e-9);
  }
}

TEST(HistoryFiller, TheFirstFeaturesHaveNoPast) {
  HistoryFiller filler{PatchOptions{}};
  filler.Begin(SmoothPyramid(test::ShiftedNoise({0, 0}), 0.0));
  const FilledHistory past = filler.Fill(
      kBorn, TakeAnchor(filler.newest(), kBorn, 21, 31), History(1, Eigen::Matrix2Xd(2, 0)), {});
  ASSERT_EQ(past.xy.size(), 1u);
  EXPECT_EQ(past.xy[0], kBorn);
  EXPECT_TRUE(past.measured[0].anchor);
}

}  // namespace
}  // namespace cohort
