// The trackers that follow every feature for itself, on pictures in closed form.

#include <gtest/gtest.h>

#include <cctype>
#include <opencv2/core/utility.hpp>
#include <string>
#include <vector>

#include "frontend/track/tracker.h"
#include "tests/support/closed_form_image.h"

namespace cohort {
namespace {

constexpr int kWidth = 200;
constexpr int kHeight = 150;

cv::Mat Picture(double dx, double dy) {
  return test::ImageOf(
      [=](double x, double y) { return test::NoiseAt(x - dx, y - dy); }, kWidth, kHeight, CV_8U);
}

std::vector<Eigen::Vector2d> Grid() {
  std::vector<Eigen::Vector2d> grid;
  for (int y = 30; y <= 120; y += 15) {
    for (int x = 30; x <= 170; x += 14) grid.emplace_back(x + 0.3, y + 0.6);
  }
  return grid;
}

struct Baseline {
  TrackerKind tracker;
  double accuracy_px;  // of nine tenths of the features
};

class BaselineTracker : public testing::TestWithParam<Baseline> {
 protected:
  std::unique_ptr<FeatureMover> Mover() const {
    TrackerOptions options;
    options.tracker = GetParam().tracker;
    return MakeMover(options);
  }
};

TEST_P(BaselineTracker, FollowsFractionsOfAPixelOverSeveralFrames) {
  const auto mover = Mover();
  const auto born = Grid();
  mover->Add(born, BuildPyramid(Picture(0, 0)));
  std::vector<Move> moves;
  for (int t = 1; t <= 3; ++t) {
    moves = mover->MoveFeatures(BuildPyramid(Picture(1.3 * t, -0.9 * t)));
    mover->Keep(std::vector<std::uint8_t>(born.size(), 1));
  }
  ASSERT_EQ(moves.size(), born.size());
  std::size_t good = 0;
  for (std::size_t f = 0; f < born.size(); ++f) {
    const double error_px = (moves[f].xy - born[f] - Eigen::Vector2d(3.9, -2.7)).norm();
    good += !moves[f].loss && error_px < GetParam().accuracy_px ? 1 : 0;
    EXPECT_TRUE(moves[f].loss || moves[f].residual < 0.1) << moves[f].residual;
  }
  EXPECT_GE(good, born.size() * 9 / 10);
}

// A textured bar, 40 px wide from `left` on, before the background.
cv::Mat BarBefore(const cv::Mat& background, int left) {
  cv::Mat picture = background.clone();
  test::ImageOf(
      [](double x, double y) { return test::NoiseAt(y + 500, 1.5 * x + 900); }, 40, kHeight, CV_8U)
      .copyTo(picture(cv::Rect(left, 0, 40, kHeight)));
  return picture;
}

TEST_P(BaselineTracker, DoesNotObserveWhatSomethingElseHides) {
  const auto mover = Mover();
  std::vector<Eigen::Vector2d> born;
  for (int y = 30; y <= 120; y += 6) born.emplace_back(85.3, y);  // the bar will hide these
  const std::size_t hidden = born.size();
  for (int y = 30; y <= 120; y += 6) born.emplace_back(150.3, y);
  mover->Add(born, BuildPyramid(BarBefore(Picture(0, 0), 40)));
  const std::vector<Move> moves = mover->MoveFeatures(BuildPyramid(BarBefore(Picture(-1, 0), 50)));
  std::size_t hidden_refused = 0;
  std::size_t seen_refused = 0;
  for (std::size_t f = 0; f < born.size(); ++f) {
    if (moves[f].loss || moves[f].state == ObservationState::kPredicted) {
      ++(f < hidden ? hidden_refused : seen_refused);
    }
  }
  EXPECT_GE(hidden_refused, hidden * 3 / 4);
  EXPECT_LE(seen_refused, (born.size() - hidden) / 10);
}

TEST_P(BaselineTracker, KeepsTheOthersWhereTheyAreWhenSomeEndAndNewOnesCome) {
  const auto mover = Mover();
  const auto born = Grid();
  mover->Add(born, BuildPyramid(Picture(0, 0)));
  const Pyramid second = BuildPyramid(Picture(1.3, -0.9));
  mover->MoveFeatures(second);
  std::vector<std::uint8_t> keep(born.size(), 0);
  keep[40] = 1;
  mover->Keep(keep);
  const std::vector<Eigen::Vector2d> late{{90.5, 70.2}};
  mover->Add(late, second);
  const std::vector<Move> moves = mover->MoveFeatures(BuildPyramid(Picture(2.6, -1.8)));
  ASSERT_EQ(moves.size(), 2u);
  EXPECT_LT((moves[0].xy - born[40] - Eigen::Vector2d(2.6, -1.8)).norm(), 0.3);
  EXPECT_LT((moves[1].xy - late[0] - Eigen::Vector2d(1.3, -0.9)).norm(), 0.3);
}

TEST_P(BaselineTracker, SaysTheSameWithAnyNumberOfThreads) {
  const auto born = Grid();
  const auto moves_with = [&](int threads) {
    cv::setNumThreads(threads);
    const auto mover = Mover();
    mover->Add(born, BuildPyramid(Picture(0, 0)));
    auto moves = mover->MoveFeatures(BuildPyramid(BarBefore(Picture(1.3, -0.9), 60)));
    cv::setNumThreads(-1);
    return moves;
  };
  const std::vector<Move> one = moves_with(1);
  const std::vector<Move> two = moves_with(2);
  for (std::size_t f = 0; f < born.size(); ++f) {
    EXPECT_EQ(one[f].xy, two[f].xy);
    EXPECT_EQ(one[f].loss, two[f].loss);
  }
}

INSTANTIATE_TEST_SUITE_P(All,
                         BaselineTracker,
                         testing::Values(Baseline{TrackerKind::kKlt, 0.1},
                                         Baseline{TrackerKind::kAnchoredKlt, 0.1},
                                         Baseline{TrackerKind::kRlof, 0.15}),
                         [](const auto& info) {
                           std::string name(NameOf(kTrackerNames, info.param.tracker));
                           std::erase(name, '-');
                           name[0] = static_cast<char>(std::toupper(name[0]));
                           return name;
                         });

}  // namespace
}  // namespace cohort
