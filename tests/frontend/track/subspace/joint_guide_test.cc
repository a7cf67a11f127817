#include "frontend/track/subspace/joint_guide.h"

#include <gtest/gtest.h>

#include "tests/frontend/track/moving_picture.h"
#include "tests/support/plane_scene.h"

namespace cohort {
namespace {

std::vector<std::vector<Eigen::Vector2d>> BirthsAt(const Eigen::Matrix2Xd& x,
                                                   std::size_t frames = 1) {
  std::vector<std::vector<Eigen::Vector2d>> births;
  for (const Eigen::Vector2d xy : x.colwise()) births.emplace_back(frames, xy);
  return births;
}

// Follows points of a rigid scene whose past is known, in frames in which the image does not
// confirm one of them and its template is that of another place. Returns that one's error in the
// last frame.
double ErrorOfTheContradicted(const SubspaceOptions& options) {
  constexpr std::size_t kContradicted = 7;
  constexpr int kKnownFrames = 8;
  const test::PlaneScene scene;
  const auto picture = [&](int t) {
    return BuildPyramid(scene.Render(test::PlaneScene::CamFromWorld(t)));
  };
  std::vector<Eigen::Vector3d> points;
  for (int y = 50; y < 200; y += 30) {
    for (int x = 70; x < 270; x += 24) {
      const auto point = scene.PointAt(test::PlaneScene::CamFromWorld(0),
                                       {static_cast<double>(x), static_cast<double>(y)});
      if (point && scene.IsVisible(test::PlaneScene::CamFromWorld(10), *point)) {
        points.push_back(*point);
      }
    }
  }
  const auto truth = [&](int t) {
    Eigen::Matrix2Xd x(2, static_cast<Eigen::Index>(points.size()));
    for (std::size_t f = 0; f < points.size(); ++f) {
      x.col(static_cast<Eigen::Index>(f)) =
          *scene.camera().Project(test::PlaneScene::CamFromWorld(t) * points[f]);
    }
    return x;
  };
  std::vector<Feature> features = test::FeaturesAt(picture(0), truth(0));
  JointGuide guide(options);
  guide.Begin(picture(0));
  guide.Add(BirthsAt(truth(0)), picture(0), features);
  for (int t = 1; t < kKnownFrames; ++t) guide.Remember(picture(t), truth(t), features);
  features[kContradicted].templates = TakeTemplates(picture(0), {30, 220}, options.template_px);
  features[kContradicted].confirmed = false;
  for (int t = kKnownFrames; t < kKnownFrames + 3; ++t) {
    const Pyramid current = picture(t);
    guide.Remember(current, guide.Minimize(current, features, guide.Start(current)).x, features);
  }
  const Eigen::Matrix2Xd errors = guide.history().front() - truth(kKnownFrames + 2);
  return errors.col(kContradicted).norm();
}

TEST(JointGuide, HoldsAFeatureThatTheImageContradicts) {
  SubspaceOptions alone;
  alone.penalty_weight = 0.0;
  EXPECT_GT(ErrorOfTheContradicted(alone), 2.0);
  // The nuclear norm holds less well: it shrinks every motion, not only what adds a dimension.
  for (const PenaltyKind penalty :
       {PenaltyKind::kEmpiricalDimension, PenaltyKind::kExplicitFactorization}) {
    SubspaceOptions options;
    options.penalty = penalty;
    EXPECT_LT(ErrorOfTheContradicted(options), 1.0) << NameOf(kPenaltyNames, penalty);
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

// The weight goes by the new scene's contrast: a dark one behind a bright one is no other than a dark
// one alone.
TEST(JointGuide, BeginsAnewWithoutTheContrastOfTheOldScene) {
  const Pyramid bright = test::ShiftedNoise({0, 0});
  const Pyramid dark = BuildPyramid(0.05 * bright.levels[0]);
  const Pyramid next = BuildPyramid(0.05 * test::ShiftedNoise({1.5, -0.5}).levels[0]);
  Eigen::Matrix2Xd born(2, 5);
  born << 50, 90, 130, 60, 110, 60, 70, 80, 100, 50;
  const std::vector<Feature> features = test::FeaturesAt(dark, born);
  const auto begin = [&](JointGuide& guide) {
    guide.Begin(dark);
    guide.Add(BirthsAt(born), dark, features);
    return guide.Minimize(next, features, born);
  };
  JointGuide fresh{SubspaceOptions()};
  JointGuide used{SubspaceOptions()};
  used.Begin(bright);
  used.Add(BirthsAt(born), bright, test::FeaturesAt(bright, born));
  const OptimizerResult a = begin(used);
  const OptimizerResult b = begin(fresh);
  EXPECT_EQ(a.x, b.x);
  EXPECT_EQ(a.energy, b.energy);
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
  const Pyramid bright = test::ShiftedNoise({0, 0});
  Pyramid dark;
  for (const cv::Mat& level : bright.levels) dark.levels.emplace_back(0.25 * level);
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
