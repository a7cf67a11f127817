#include "frontend/track/joint_guide.h"

#include <gtest/gtest.h>

#include "tests/frontend/track/moving_picture.h"

namespace cohort {
namespace {

const Eigen::Vector2d kMotion(1.7, -0.8);  // [px] a frame

std::vector<std::vector<Eigen::Vector2d>> BirthsAt(const Eigen::Matrix2Xd& x,
                                                   std::size_t frames = 1) {
  std::vector<std::vector<Eigen::Vector2d>> births;
  for (const Eigen::Vector2d xy : x.colwise()) births.emplace_back(frames, xy);
  return births;
}

// Follows the grid for some frames of the moving picture; feature 7 has the template of another
// place, and the image confirms it in the first frame only. Returns its error in the last frame.
double ErrorOfTheContradicted(const SubspaceOptions& options) {
  const Pyramid first = test::ShiftedNoise({0, 0});
  const Eigen::Matrix2Xd born = test::GridOfTwenty();
  std::vector<Feature> features = test::FeaturesAt(first, born);
  features[7].templates = TakeTemplates(first, {20, 150}, options.template_px);
  JointGuide guide(options);
  guide.Begin(first);
  guide.Add(BirthsAt(born), first, features);
  for (int t = 1; t <= 6; ++t) {
    const Pyramid picture = test::ShiftedNoise(t * kMotion);
    const Eigen::Matrix2Xd x = guide.Minimize(picture, features, guide.Start(picture)).x;
    features[7].confirmed = false;
    guide.Remember(picture, x, features);
  }
  const Eigen::Matrix2Xd errors = guide.history().front().colwise() - 6 * kMotion - born;
  EXPECT_LT(errors.col(0).norm(), 0.1);
  EXPECT_LT(errors.col(19).norm(), 0.1);
  return errors.col(7).norm();
}

TEST(JointGuide, HoldsAFeatureThatTheImageContradicts) {
  SubspaceOptions alone;
  alone.penalty_weight = 0.0;
  EXPECT_GT(ErrorOfTheContradicted(alone), 2.0);
  for (const auto& [name, penalty] : kPenaltyNames) {
    SubspaceOptions options;
    options.penalty = penalty;
    EXPECT_LT(ErrorOfTheContradicted(options), 1.0) << name;
  }
}

TEST(JointGuide, StartsAtTheShiftOfTheWholePicture) {
  const Pyramid first = test::ShiftedNoise({0, 0});
  const Eigen::Matrix2Xd born = test::GridOfTwenty();
  JointGuide guide({});
  guide.Begin(first);
  guide.Add(BirthsAt(born), first, test::FeaturesAt(first, born));
  const Eigen::Matrix2Xd start = guide.Start(test::ShiftedNoise({7, 5}));
  EXPECT_LT((start.colwise() - Eigen::Vector2d(7, 5) - born).colwise().norm().maxCoeff(), 1.0);
}

TEST(JointGuide, KeepsTheNewestFramesOfWhatIsKept) {
  const Pyramid picture = test::ShiftedNoise({0, 0});
  SubspaceOptions options;
  options.history_length = 3;
  JointGuide guide(options);
  Eigen::Matrix2Xd born(2, 3);
  born << 50, 90, 130, 60, 70, 80;
  std::vector<Feature> features = test::FeaturesAt(picture, born);
  guide.Begin(picture);
  guide.Add(BirthsAt(born), picture, features);
  for (int t = 1; t <= 4; ++t) {
    guide.Remember(picture, born.array() + t, features);
  }
  ASSERT_EQ(guide.history().size(), 3u);
  EXPECT_EQ(guide.history()[0], (born.array() + 4).matrix());
  EXPECT_EQ(guide.history()[2], (born.array() + 2).matrix());

  const std::vector<std::uint8_t> keep{1, 0, 1};
  guide.Keep(keep);
  KeepFeatures(keep, features);
  features.push_back(test::FeaturesAt(picture, born.col(1)).front());
  guide.Add(std::vector<std::vector<Eigen::Vector2d>>{{{1, 2}, {3, 4}, {5, 6}}}, picture, features);
  Eigen::Matrix2Xd oldest(2, 3);
  oldest << 52, 132, 5, 62, 82, 6;
  EXPECT_EQ(guide.history()[2], oldest);
}

// Paper equation (7), with m over the picture's contrast.
TEST(DataWeight, IsOneOverTheFeaturesForAStrongConstraintAndOneForAWeak) {
  SubspaceOptions options;
  options.penalty_weight = 2.0;
  const double strong_m = 2.0 * CalibratedWeight(options.penalty, Constraint::kStrong);
  EXPECT_DOUBLE_EQ(*DataWeight(options, 0.25, 50), 1.0 / (strong_m * 50 * 0.25));
  options.constraint = Constraint::kWeak;
  const double weak_m = 2.0 * CalibratedWeight(options.penalty, Constraint::kWeak);
  EXPECT_DOUBLE_EQ(*DataWeight(options, 0.25, 50), 1.0 / (weak_m * 0.25));
  EXPECT_FALSE(DataWeight(options, 0.0, 50));
  options.penalty_weight = 0.0;
  EXPECT_FALSE(DataWeight(options, 0.25, 50));
}

TEST(Contrast, GrowsWithThePictureAndAsksWhatIsConfirmed) {
  Pyramid bright = test::ShiftedNoise({0, 0});
  Pyramid dark = bright;
  for (cv::Mat& level : dark.levels) level = 0.25 * level;
  const Eigen::Matrix2Xd x = test::GridOfTwenty();
  std::vector<Feature> features = test::FeaturesAt(dark, x);
  const double of_dark = Contrast(dark.levels[0], x, features, 11);
  EXPECT_GT(of_dark, 0.0);
  EXPECT_NEAR(Contrast(bright.levels[0], x, test::FeaturesAt(bright, x), 11), 4.0 * of_dark, 1e-6);
  for (Feature& feature : features) feature.confirmed = false;
  EXPECT_EQ(Contrast(dark.levels[0], x, features, 11), 0.0);
}

}  // namespace
}  // namespace cohort
