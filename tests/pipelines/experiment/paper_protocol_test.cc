#include "pipelines/experiment/paper_protocol.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "pipelines/experiment/paper_tables.h"
#include "tests/support/closed_form_image.h"

namespace cohort {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

// Every feature drifts by the same step a frame and is lost after `life` of them.
class DriftingMover final : public FeatureMover {
 public:
  explicit DriftingMover(const Eigen::Vector2d& step, int life = 1000) : step_(step), life_(life) {}

  std::vector<Move> MoveFeatures(const Pyramid&) override {
    std::vector<Move> moves;
    for (auto& [xy, age] : features_) {
      xy += step_;
      Move move;
      move.xy = xy;
      if (++age >= life_) move.loss = LossReason::kDiverged;
      moves.push_back(move);
    }
    return moves;
  }
  void Keep(std::span<const std::uint8_t> keep) override {
    ASSERT_EQ(keep.size(), features_.size());
    std::size_t f = 0;
    std::erase_if(features_, [&](const auto&) { return keep[f++] == 0; });
  }
  void Add(std::span<const Eigen::Vector2d> born, const Pyramid&) override {
    for (const auto& xy : born) {
      features_.emplace_back(xy, 0);
      starts.push_back(xy.x());
    }
  }

  std::vector<double> starts;

 private:
  Eigen::Vector2d step_;
  int life_;
  std::vector<std::pair<Eigen::Vector2d, int>> features_;
};

FrameSource BlankFrames(int count) {
  return [i = 0, count]() mutable -> std::optional<Frame> {
    if (i == count) return std::nullopt;
    Frame frame;
    frame.index = FrameIndex{static_cast<std::uint32_t>(i++)};
    frame.gray = cv::Mat::zeros(64, 64, CV_8U);
    return frame;
  };
}

// Moves by 1 px a frame to the right.
FollowedPoint Point(std::size_t birth, std::size_t frames, double x) {
  FollowedPoint point{birth, {}};
  for (std::size_t i = 0; i < frames; ++i) point.xy.emplace_back(x + static_cast<double>(i), 20.0);
  return point;
}

TEST(Reinitializations, StartAFeatureAtItsTruthAsSoonAsItIsTooFarOff) {
  DriftingMover mover({4.0, 0.0});  // 3 px off after a frame, then 6, 9, 12
  const ReinitializationRun run =
      RunReinitializations(mover, BlankFrames(13), {Point(0, 13, 100.0)}, 10.0);
  EXPECT_EQ(run.frames, 9u);
  EXPECT_EQ(run.reinitializations, 3u);
  EXPECT_EQ(run.lost, 0u);
  EXPECT_EQ(run.MeanFramesBetween(), 3.0);
  EXPECT_THAT(mover.starts, ElementsAre(100.0, 104.0, 108.0, 112.0));
}

TEST(Reinitializations, CountWhatATrackerGivesUp) {
  DriftingMover mover({1.0, 0.0}, 2);
  const ReinitializationRun run =
      RunReinitializations(mover, BlankFrames(7), {Point(0, 7, 100.0)}, 10.0);
  EXPECT_EQ(run.frames, 3u);
  EXPECT_EQ(run.reinitializations, 3u);
  EXPECT_EQ(run.lost, 3u);
}

TEST(Reinitializations, FollowAPointFromItsBirthToItsEnd) {
  DriftingMover mover({1.0, 0.0});
  const ReinitializationRun run =
      RunReinitializations(mover, BlankFrames(10), {Point(0, 4, 100.0), Point(2, 6, 200.0)}, 10.0);
  EXPECT_EQ(run.frames, 3u + 5u);
  EXPECT_EQ(run.reinitializations, 0u);
  EXPECT_EQ(run.MeanFramesBetween(), 8.0);  // at least
  EXPECT_THAT(mover.starts, ElementsAre(100.0, 200.0));
}

TEST(Trajectories, SumTheErrorOverTheFrames) {
  DriftingMover mover({2.0, -2.0});  // off by (1, -2) a frame
  const TrajectoryRun run = RunTrajectories(
      mover, BlankFrames(10), {Point(0, 4, 100.0), Point(0, 9, 50.0), Point(2, 5, 10.0)}, 3);
  EXPECT_EQ(run.features, 2u);
  EXPECT_EQ(run.lost, 0u);
  EXPECT_DOUBLE_EQ(run.mean_l1_px, 3.0 + 6.0 + 9.0);
  EXPECT_THAT(run.last_xy, ElementsAre(Eigen::Vector2d(106, 14), Eigen::Vector2d(56, 14)));
}

TEST(Trajectories, AFeatureThatIsGivenUpStaysWhereItWas) {
  DriftingMover mover({2.0, -2.0}, 2);
  const TrajectoryRun run = RunTrajectories(mover, BlankFrames(10), {Point(0, 4, 100.0)}, 3);
  EXPECT_EQ(run.lost, 1u);
  // Once off by (1, -2); then it stays while the point goes on by 1 px a frame.
  EXPECT_DOUBLE_EQ(run.mean_l1_px, 3.0 + 2.0 + 3.0);
}

// A texture that moves by 1 px a frame to the left.
class SlidingClip final : public Sequence {
 public:
  static constexpr int kFrames = 50;

  std::optional<Frame> Next() override {
    if (next_ == kFrames) return std::nullopt;
    Frame frame;
    frame.index = FrameIndex{static_cast<std::uint32_t>(next_)};
    frame.gray = test::ImageOf(
        [this](double x, double y) { return test::NoiseAt(x + next_, y); }, 200, 150, CV_8U);
    ++next_;
    return frame;
  }
  void Rewind() override { next_ = 0; }
  std::string Name() const override { return "sliding"; }
  std::filesystem::path ImageRoot() const override { return {}; }
  std::optional<std::size_t> FrameCount() const override { return kFrames; }
  std::optional<Camera> KnownCamera() const override { return std::nullopt; }
  const std::map<FrameIndex, Rigid3>& TrueCamFromWorld() const override { return none_; }
  std::optional<cv::Mat> TrueDepth(FrameIndex) const override { return std::nullopt; }
  std::optional<cv::Mat> OccluderMask(FrameIndex) const override { return std::nullopt; }
  const std::string& Warning() const override { return warning_; }

 private:
  int next_ = 0;
  std::map<FrameIndex, Rigid3> none_;
  std::string warning_;
};

// Of that clip: depth jumps at x = 100 of the texture, and what is above y = 60 is hidden from
// frame 10 on.
class SlidingTruth final : public TrackTruth {
 public:
  std::optional<Anchor> Pick(FrameIndex frame, const Eigen::Vector2d& xy) override {
    Anchor anchor;
    anchor.x_in_world = {xy.x() + ToInt(frame), xy.y(), 1.0};
    return anchor;
  }
  std::optional<TruePosition> Locate(const Anchor& anchor, FrameIndex frame) override {
    TruePosition position;
    position.xy = {anchor.x_in_world.x() - ToInt(frame), anchor.x_in_world.y()};
    position.in_image = position.xy.x() >= 0;
    position.visible = position.in_image && (position.xy.y() > 60 || ToInt(frame) < 10);
    return position;
  }
  bool IsOnDepthEdge(FrameIndex frame, const Eigen::Vector2d& xy, double radius_px) override {
    return std::abs(xy.x() + ToInt(frame) - 100) <= radius_px;
  }
};

TEST(ChoosePoints, TakesCornersWithAFitTruthAndRenewsThem) {
  SlidingClip clip;
  SlidingTruth truth;
  PaperProtocolOptions options;
  options.features = 60;
  options.window_frames = 20;
  const auto points = ChoosePoints(clip, truth, {}, options);
  std::size_t at_start = 0;
  std::size_t later = 0;
  for (const FollowedPoint& point : points) {
    ++(point.birth == 0 ? at_start : later);
    EXPECT_TRUE(point.birth == 0 || point.birth == 20);
    EXPECT_GT(point.xy.size(), 20u);
    const double in_texture = point.xy.front().x() + static_cast<double>(point.birth);
    EXPECT_GT(std::abs(in_texture - 100), 10.0);
    EXPECT_GT(point.xy.front().y(), point.birth < 10 ? 60.0 : 16.0);
    for (const Eigen::Vector2d& xy : point.xy) EXPECT_GE(xy.x(), 16.0);
    EXPECT_TRUE(point.end() == SlidingClip::kFrames || point.xy.back().x() < 17.0);
  }
  EXPECT_GT(at_start, 10u);
  EXPECT_GT(later, 2u);
}

TEST(PaperTables, HaveThePapersLayoutAndSayHowManyTimesBetter) {
  ExperimentResults results;
  const auto add = [&](const char* sequence,
                       const char* tracker,
                       unsigned seed,
                       double l1,
                       double frames,
                       double reinitializations) {
    const auto row = [&](const char* metric, double value) {
      results.rows.push_back({sequence, "medium", tracker, "", seed, metric, value, ""});
    };
    row("l1_error_30_frames", l1);
    row("frames_between_reinitializations", frames);
    row("reinitializations", reinitializations);
  };
  add("room", "klt7", 1, 300, 10, 100);
  add("room", "klt7", 2, 500, 8, 120);
  add("room", "klt21", 1, 90, 20, 50);
  add("room", "klt21", 2, 110, 20, 50);
  add("room", "subspace", 1, 30, 1000, 0);
  add("room", "subspace", 2, 50, 500, 0);
  add("cloth", "klt7", 1, 100, 40, 20);
  add("cloth", "klt21", 1, 120, 30, 30);
  add("cloth", "subspace", 1, 20, 120, 8);
  EXPECT_EQ(PaperTables(results),
            "medium: mean L1 trajectory error after 30 frames [px], lower is better\n"
            "tracker              room  cloth  average\n"
            "-----------------------------------------\n"
            "klt7      400.0 (300-500)  100.0    250.0\n"
            "klt21      100.0 (90-110)  120.0    110.0\n"
            "subspace     40.0 (30-50)   20.0     30.0\n"
            "\n"
            "medium: mean frames between re-initialisations, higher is better\n"
            "tracker                room  cloth  average\n"
            "-------------------------------------------\n"
            "klt7             9.0 (8-10)   40.0     24.5\n"
            "klt21          20.0 (20-20)   30.0     25.0\n"
            "subspace  >750.0 (500-1000)  120.0    435.0\n"
            "\n"
            "medium: L1 error, tracker / subspace\n"
            "tracker            room  cloth  average\n"
            "---------------------------------------\n"
            "klt7              10.00   5.00     8.33\n"
            "klt21              2.60   6.00     3.67\n"
            "klt, best window   2.60   5.00     3.33\n"
            "\n"
            "medium: frames between re-initialisations, subspace / tracker\n"
            "tracker            room  cloth  average\n"
            "---------------------------------------\n"
            "klt7              81.25   3.00    17.76\n"
            "klt21             37.50   4.00    17.40\n"
            "klt, best window  37.50   3.00    14.50\n"
            "\n");
}

TEST(PaperTables, TheBestWindowIsOfKltAlone) {
  ExperimentResults results;
  for (const char* tracker : {"klt21", "klt-mine", "klt31-refined", "subspace"}) {
    results.rows.push_back({"room", "hard", tracker, "", 1, "l1_error_30_frames", 9.0, "px"});
  }
  EXPECT_THAT(PaperTables(results), Not(HasSubstr("best window")));
  results.rows.push_back({"room", "hard", "klt31", "", 1, "l1_error_30_frames", 9.0, "px"});
  EXPECT_THAT(PaperTables(results), HasSubstr("klt, best window"));
}

TEST(PaperTables, AveragesRatiosAndWinsAreThoseOfTheTables) {
  ExperimentResults results;
  const auto add = [&](const char* sequence, const char* tracker, double l1) {
    results.rows.push_back({sequence, "hard", tracker, "", 1, "l1_error_30_frames", l1, "px"});
  };
  add("room", "klt7", 300);
  add("room", "subspace", 20);
  add("cloth", "klt7", 20);
  add("cloth", "subspace", 60);
  EXPECT_EQ(RatioOfAverages(results, "hard", "l1_error_30_frames", "klt7", "subspace"), 4.0);
  EXPECT_EQ(RatioOfAverages(results, "medium", "l1_error_30_frames", "klt7", "subspace"),
            std::nullopt);
  EXPECT_EQ(AverageOf(results, "hard", "l1_error_30_frames", "klt7"), 160.0);
  EXPECT_EQ(AverageOf(results, "hard", "l1_error_30_frames", "klt7", {"cloth"}), 20.0);
  EXPECT_EQ(AverageOf(results, "hard", "l1_error_30_frames", "klt7", {"cloth", "street"}),
            std::nullopt);
  EXPECT_EQ(SequencesWon(results, "hard", "subspace", {"klt7"}), 1);
}

TEST(PaperTables, ACellWithoutAFigureIsAFailureAndNoAverage) {
  ExperimentResults results;
  results.rows.push_back({"room", "hard", "klt", "", 1, "l1_error_30_frames", 9.0, "px"});
  results.rows.push_back({"room", "hard", "rlof", "", 1, "failed", 1.0, ""});
  EXPECT_THAT(PaperTables(results), HasSubstr("rlof     FAILED   FAILED\n"));
  // One seed of two is as bad.
  results.rows.push_back({"room", "hard", "klt", "", 2, "failed", 1.0, ""});
  EXPECT_THAT(PaperTables(results), HasSubstr("klt      FAILED   FAILED\n"));
}

}  // namespace
}  // namespace cohort
