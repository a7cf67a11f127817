#include "frontend/track/subspace/joint_guide.h"

#include <gtest/gtest.h>

#include "tests/frontend/track/moving_picture.h"
#include "tests/support/plane_scene.h"

namespace cohort {
namespace {

std::vector<Eigen::Vector2d> Columns(const Eigen::Matrix2Xd& x) {
  return {x.colwise().begin(), x.colwise().end()};
}

std::vector<std::uint8_t> AllOf(const Eigen::Matrix2Xd& x) {
  return std::vector<std::uint8_t>(static_cast<std::size_t>(x.cols()), 1);
}

SubspaceOptions WithPenalty() {
  SubspaceOptions options;
  options.penalty = PenaltyKind::kEmpiricalDimension;
  return options;
}

// Follows points of a rigid scene whose past is known, in frames in which the image does not
// confirm one of them, which looked otherwise at its birth. Returns that one's error in the last
// frame.
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
  cv::Mat first = picture(0).levels[0].clone();
  const Eigen::Vector2d place = truth(0).col(kContradicted);
  const cv::Rect around(static_cast<int>(place.x()) - 8, static_cast<int>(place.y()) - 8, 17, 17);
  first(cv::Rect(20, 210, 17, 17)).copyTo(first(around));
  JointGuide guide(options);
  guide.Begin(picture(0));
  guide.Add(Columns(truth(0)), BuildPyramid(first));
  std::vector<std::uint8_t> confirmed = AllOf(truth(0));
  for (int t = 1; t < kKnownFrames; ++t) guide.Remember(picture(t), truth(t), confirmed);
  confirmed[kContradicted] = 0;
  for (int t = kKnownFrames; t < kKnownFrames + 3; ++t) {
    const Pyramid current = picture(t);
    guide.Remember(current, guide.Find(current, confirmed), confirmed);
  }
  const Eigen::Matrix2Xd errors = guide.history().front() - truth(kKnownFrames + 2);
  return errors.col(kContradicted).norm();
}

TEST(JointGuide, HoldsAFeatureThatTheImageContradicts) {
  EXPECT_GT(ErrorOfTheContradicted(SubspaceOptions()), 2.0);
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
  guide.Add(Columns(born), first);
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
  guide.Begin(picture);
  guide.Add(Columns(born), picture);
  for (int t = 1; t <= 4; ++t) guide.Remember(picture, born.array() + t, AllOf(born));
  ASSERT_EQ(guide.history().size(), 3u);
  EXPECT_EQ(guide.history()[0], (born.array() + 4).matrix());
  EXPECT_EQ(guide.history()[2], (born.array() + 2).matrix());

  guide.Keep(std::vector<std::uint8_t>{1, 0, 1});
  EXPECT_EQ(guide.templates().size(), 2u);
  Eigen::Matrix2Xd oldest(2, 2);
  oldest << 52, 132, 62, 82;
  EXPECT_EQ(guide.history()[2], oldest);
}

TEST(JointGuide, ANewFeatureWasWhereItsNeighboursCameFrom) {
  const Pyramid picture = test::ShiftedNoise({0, 0});
  JointGuide guide(SubspaceOptions{});
  const Eigen::Vector2d step(1, 2);
  const Eigen::Matrix2Xd born = test::GridOfTwenty();
  guide.Begin(picture);
  guide.Add(Columns(born), picture);
  for (int t = 1; t <= 3; ++t) guide.Remember(picture, born.colwise() + t * step, AllOf(born));
  const Eigen::Vector2d xy(100, 80);
  guide.Add(std::vector<Eigen::Vector2d>{xy}, picture);
  for (int l = 0; l <= 3; ++l) {
    EXPECT_LT((guide.history()[static_cast<std::size_t>(l)].col(20) - (xy - l * step)).norm(), 1e-9)
        << l;
  }
}

// The weight goes by the new scene's contrast: a dark one behind a bright one is no other than a
// dark one alone.
TEST(JointGuide, BeginsAnewWithoutTheContrastOfTheOldScene) {
  const Pyramid bright = test::ShiftedNoise({0, 0});
  const Pyramid dark = BuildPyramid(0.05 * bright.levels[0]);
  const Pyramid next = BuildPyramid(0.05 * test::ShiftedNoise({1.5, -0.5}).levels[0]);
  Eigen::Matrix2Xd born(2, 5);
  born << 50, 90, 130, 60, 110, 60, 70, 80, 100, 50;
  const auto begin = [&](JointGuide& guide) {
    guide.Begin(dark);
    guide.Add(Columns(born), dark);
    return guide.Minimize(next, AllOf(born), born);
  };
  JointGuide fresh{WithPenalty()};
  JointGuide used{WithPenalty()};
  used.Begin(bright);
  used.Add(Columns(born), bright);
  const OptimizerResult a = begin(used);
  const OptimizerResult b = begin(fresh);
  EXPECT_EQ(a.x, b.x);
  EXPECT_EQ(a.energy, b.energy);
}

// Paper equation (7), with m over the picture's contrast.
TEST(DataWeight, IsOneOverTheFeaturesForAStrongConstraintAndOneForAWeak) {
  SubspaceOptions options = WithPenalty();
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
  const auto contrast = [&](const Pyramid& picture, std::uint8_t confirmed) {
    std::vector<Templates> templates;
    for (const Eigen::Vector2d xy : x.colwise()) {
      templates.push_back(TakeTemplates(picture, xy, 11));
    }
    return Contrast(picture.levels[0], x, templates, std::vector<std::uint8_t>(20, confirmed), 11);
  };
  const double of_dark = contrast(dark, 1);
  EXPECT_GT(of_dark, 0.0);
  EXPECT_NEAR(contrast(bright, 1), 4.0 * of_dark, 1e-6);
  EXPECT_EQ(contrast(dark, 0), 0.0);
}

}  // namespace
}  // namespace cohort
