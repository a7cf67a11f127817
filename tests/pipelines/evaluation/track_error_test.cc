#include "pipelines/evaluation/track_error.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <numeric>

#include "frontend/core/random_stream.h"

namespace cohort {
namespace {

constexpr ReinitializationOptions kImage{
    .limit_px = 10.0, .border_px = 16.0, .width_px = 640, .height_px = 480};
const Eigen::Vector2d kVelocity(2.0, -1.0);  // of every surface point [px per frame]

// Everything moves at kVelocity; a point is hidden in the frames that `hidden` says.
TrackTruthOracle Moving(const std::function<bool(std::uint32_t)>& hidden = [](auto) {
  return false;
}) {
  return [hidden](FrameIndex anchor, const Eigen::Vector2d& xy) -> std::optional<TruePath> {
    if (xy.x() < 0.0) return std::nullopt;  // no surface there
    return [=](FrameIndex frame) -> std::optional<TrueSighting> {
      const double steps = static_cast<double>(ToInt(frame)) - ToInt(anchor);
      const Eigen::Vector2d now = xy + steps * kVelocity;
      const bool inside = now.x() >= 0 && now.y() >= 0 && now.x() <= 639 && now.y() <= 479;
      return TrueSighting{.xy = now, .visible = inside && !hidden(ToInt(frame))};
    };
  };
}

// Observations that follow the truth with an error of error(frame) along x.
std::vector<Observation> Track(
    std::uint32_t id,
    std::uint32_t first,
    std::uint32_t end,
    const Eigen::Vector2d& start,
    const std::function<double(std::uint32_t)>& error = [](auto) { return 0.0; },
    const std::function<bool(std::uint32_t)>& predicted = [](auto) { return false; }) {
  std::vector<Observation> track;
  for (std::uint32_t f = first; f < end; ++f) {
    track.push_back(
        {.feature = FeatureId{id},
         .frame = FrameIndex{f},
         .xy = start + (f - first) * kVelocity + Eigen::Vector2d(error(f), 0.0),
         .state = predicted(f) ? ObservationState::kPredicted : ObservationState::kObserved});
  }
  return track;
}

TrackSet Join(std::initializer_list<std::vector<Observation>> tracks) {
  std::vector<Observation> all;
  for (const auto& track : tracks) all.insert(all.end(), track.begin(), track.end());
  return TrackSet::Build(std::move(all));
}

// In a clip that has a track in every frame.
TrackEvaluation Evaluate(const TrackSet& tracks,
                         const TrackTruthOracle& truth,
                         const ReinitializationOptions& options) {
  return EvaluateTracks(tracks, tracks.frames(), truth, options);
}

TEST(EvaluateTracks, ErrorIsTheDriftFromTheFirstPosition) {
  // Errors 1, 2, ... 10 px after the first; the second track begins off any corner, which is no
  // error, and stays true; the third has no truth.
  const auto tracks = Join({Track(1, 0, 11, {100, 100}, [](auto f) { return 1.0 * f; }),
                            Track(2, 5, 11, {200.3, 100.7}),
                            Track(3, 0, 11, {-50, 100})});
  const auto e = Evaluate(tracks, Moving(), kImage);
  EXPECT_EQ(e.tracks, 3u);
  EXPECT_EQ(e.tracks_without_truth, 1u);
  ASSERT_TRUE(e.observed);
  EXPECT_EQ(e.observed->count, 15u);
  EXPECT_NEAR(e.observed->mean_px, 55.0 / 15.0, 1e-12);
  EXPECT_NEAR(e.observed->median_px, 3.0, 1e-12);
  EXPECT_NEAR(e.observed->p90_px, 8.6, 1e-12);  // between 8 and 9, at 0.9 * 14 = 12.6
  EXPECT_NEAR(*e.outlier_share, 7.0 / 15.0, 1e-12);
  EXPECT_TRUE(e.predicted.empty());
  EXPECT_FALSE(e.predicted_precision);
  EXPECT_FALSE(e.predicted_recall);
}

TEST(EvaluateTracks, PredictedPositionsAreJudgedByFramesHidden) {
  const auto hidden = [](std::uint32_t f) { return f >= 10 && f < 20; };
  // One says `predicted` in time, the other two frames late and three too long.
  const auto drift = [](std::uint32_t f) { return f >= 10 && f < 23 ? 0.1 * (f - 9.0) : 0.0; };
  const auto tracks =
      Join({Track(1, 0, 30, {100, 300}, drift, hidden),
            Track(2, 0, 30, {200, 300}, drift, [](auto f) { return f >= 12 && f < 23; })});
  const auto e = Evaluate(tracks, Moving(hidden), kImage);
  ASSERT_EQ(e.predicted.size(), 4u);  // nothing is hidden for 20 frames
  EXPECT_EQ(e.predicted.at(1).count, 1u);
  EXPECT_NEAR(e.predicted.at(1).median_px, 0.1, 1e-9);
  EXPECT_EQ(e.predicted.at(5).count, 2u);
  EXPECT_NEAR(e.predicted.at(5).median_px, 0.5, 1e-9);
  EXPECT_NEAR(e.predicted.at(10).median_px, 1.0, 1e-9);
  EXPECT_EQ(e.predicted.at(0).count, 3u);
  EXPECT_NEAR(e.predicted.at(0).mean_px, 1.2, 1e-9);
  // What the second track calls observed counts too.
  ASSERT_EQ(e.hidden.size(), 3u);
  EXPECT_EQ(e.hidden.at(1).count, 2u);
  EXPECT_NEAR(e.hidden.at(1).median_px, 0.1, 1e-9);
  EXPECT_EQ(e.hidden.at(10).count, 2u);
  EXPECT_EQ(e.hidden_but_observed->count, 2u);
  EXPECT_NEAR(e.hidden_but_observed->mean_px, 0.15, 1e-9);
  EXPECT_NEAR(*e.predicted_precision, 18.0 / 21.0, 1e-12);
  EXPECT_NEAR(*e.predicted_recall, 18.0 / 20.0, 1e-12);
  // Observed: 19 of the first track, three of them before it has come back to the truth, and 18 of
  // the second, two of them while hidden.
  EXPECT_EQ(e.observed->count, 37u);
  EXPECT_NEAR(e.observed->mean_px, (1.1 + 1.2 + 1.3 + 0.1 + 0.2) / 37.0, 1e-9);
}

TEST(EvaluateTracks, HiddenFramesCountAcrossGapsAndNotWithoutTruth) {
  const auto hidden = [](std::uint32_t f) { return f >= 5; };
  auto gap = Track(
      1, 0, 10, {100, 300}, [](auto) { return 0.0; }, hidden);
  gap.erase(gap.begin() + 5, gap.begin() + 9);  // frame 9 is the fifth hidden one
  const auto other = Track(2, 0, 10, {200, 300});
  const auto e = Evaluate(Join({gap, other}), Moving(hidden), kImage);
  EXPECT_EQ(e.predicted.at(5).count, 1u);
  const auto no_truth = Evaluate(
      Join({gap, other}),
      [](FrameIndex, const Eigen::Vector2d&) -> std::optional<TruePath> {
        return [](FrameIndex) { return std::optional<TrueSighting>(); };
      },
      kImage);
  EXPECT_FALSE(no_truth.observed);
  EXPECT_TRUE(no_truth.hidden.empty());
  EXPECT_FALSE(no_truth.hidden_but_observed);
  EXPECT_TRUE(no_truth.predicted.empty());
  EXPECT_FALSE(no_truth.predicted_recall);
}

// Errors drawn with the covariance that the tracker claims, times a factor.
TrackEvaluation WithClaimedCovariance(double factor) {
  Eigen::Matrix2d true_covariance;
  true_covariance << 0.9, 0.5, 0.5, 0.4;
  const Eigen::Matrix2d L = true_covariance.llt().matrixL();
  RandomStream random(3, "test/calibration");
  auto track = Track(1, 0, 20001, {100, 100});
  const Eigen::Vector2d still = track.front().xy;
  for (Observation& o : track) {
    o.xy = still;
    if (o.frame == FrameIndex{0}) continue;
    o.xy += L * Eigen::Vector2d(random.Gaussian(), random.Gaussian());
    o.covariance = PixelCovariance::From(factor * true_covariance);
  }
  if (factor == 1.0) track.front().xy.x() -= 30.0;  // begins elsewhere: an offset of all errors
  const auto still_truth = [](FrameIndex, const Eigen::Vector2d& xy) -> std::optional<TruePath> {
    return [xy](FrameIndex) { return TrueSighting{.xy = xy, .visible = true}; };
  };
  return Evaluate(Join({track}), still_truth, kImage);
}

TEST(Calibration, RightCovariancesMakeErrorsStandardNormal) {
  const auto calibration = WithClaimedCovariance(1.0).calibration;
  ASSERT_TRUE(calibration);
  EXPECT_EQ(calibration->count, 20000u);
  EXPECT_NEAR(calibration->nees_ratio, 1.0, 0.03);
  EXPECT_NEAR(calibration->robust_sigma, 1.0, 0.02);
  EXPECT_NEAR(calibration->share_beyond_3, 0.0027, 0.001);
  const double in_all =
      std::accumulate(calibration->histogram.begin(), calibration->histogram.end(), 0.0);
  EXPECT_NEAR(in_all, 40000.0, 1.0);
  const double width = 10.0 / CalibrationFigure::kHistogramBins;
  EXPECT_NEAR(calibration->histogram[20] / (40000.0 * width), 0.3989, 0.02);
}

TEST(Calibration, CovariancesFourTimesTooSmallAreFoundOut) {
  const auto calibration = WithClaimedCovariance(0.25).calibration;
  ASSERT_TRUE(calibration);
  EXPECT_NEAR(calibration->nees_ratio, 4.0, 0.1);
  EXPECT_NEAR(calibration->robust_sigma, 2.0, 0.04);
}

// Errors of 0.1 to 2 px. A tracker that knows them, and one that claims the same of all.
TEST(Calibration, TenthsTellWhetherALargeCovarianceMeansALargeError) {
  const auto evaluate = [](bool knows) {
    RandomStream random(4, "test/calibration");
    std::vector<Observation> all;
    for (std::uint32_t id = 0; id < 40; ++id) {
      auto track = Track(id, 0, 201, {100, 100});
      const Eigen::Vector2d still = track.front().xy;
      const double sigma = 0.1 * std::pow(20.0, id / 39.0);
      for (Observation& o : track) {
        o.xy = still + sigma * Eigen::Vector2d(random.Gaussian(), random.Gaussian());
        const double claimed = knows ? sigma : 0.45;
        o.covariance = PixelCovariance::From(claimed * claimed * Eigen::Matrix2d::Identity());
      }
      all.insert(all.end(), track.begin(), track.end());
    }
    const auto still_truth = [](FrameIndex, const Eigen::Vector2d& xy) -> std::optional<TruePath> {
      return [xy](FrameIndex) { return TrueSighting{.xy = xy, .visible = true}; };
    };
    return Evaluate(TrackSet::Build(std::move(all)), still_truth, kImage).calibration->tenths;
  };
  const auto right = evaluate(true);
  ASSERT_EQ(right.size(), 10u);
  for (std::size_t i = 0; i < 10; ++i) {
    EXPECT_NEAR(right[i].nees_ratio, 1.0, 0.2) << i;
    if (i > 0) {
      EXPECT_GT(right[i].claimed_px, right[i - 1].claimed_px);
    }
  }
  EXPECT_NEAR(right.front().claimed_px, 0.11, 0.02);
  EXPECT_NEAR(right.back().claimed_px, 1.8, 0.3);
  // Ten equal claims, in the order of the tracks.
  const auto constant = evaluate(false);
  EXPECT_LT(constant.front().nees_ratio, 0.1);
  EXPECT_GT(constant.back().nees_ratio, 10.0);
}

TEST(Calibration, TracksWithoutCovarianceHaveNone) {
  EXPECT_FALSE(Evaluate(Join({Track(1, 0, 9, {100, 100})}), Moving(), kImage).calibration);
}

std::vector<FrameIndex> FramesUpTo(std::uint32_t count) {
  std::vector<FrameIndex> frames;
  for (std::uint32_t i = 0; i < count; ++i) frames.push_back(FrameIndex{i});
  return frames;
}

ReinitializationFigure MeasureIn(std::uint32_t frames,
                                 const TrackSet& tracks,
                                 const TrackTruthOracle& truth) {
  return MeasureReinitializations(tracks, FramesUpTo(frames), truth, kImage);
}

TEST(Reinitializations, AreCountedWhenATrackLeavesTheTruthOrGivesUp) {
  const auto wanders = Track(1, 0, 40, {100, 300}, [](auto f) { return f < 15 ? 9.9 : 10.1; });
  // Truth is anchored at the first position, which this one has 9.9 px off as well.
  const auto wanders_from_start = Track(2, 0, 40, {100, 300}, [](auto f) {
    return f == 0 ? 0.0 : f < 15 ? 9.9 : 10.1;
  });
  const auto lost = Track(3, 0, 11, {200, 300});
  const auto alive = Track(4, 0, 40, {300, 300});
  const auto leaves = Track(5, 0, 11, {602, 300});  // then at (624, 289): within the border
  const auto figure =
      MeasureIn(40, Join({wanders, wanders_from_start, lost, alive, leaves}), Moving());
  EXPECT_EQ(figure.frames, 39u + 14u + 10u + 39u + 10u);
  EXPECT_EQ(figure.reinitializations, 2u);
  EXPECT_NEAR(*figure.mean_frames_between, 112.0 / 2.0, 1e-12);

  const auto hidden = [](std::uint32_t f) { return f >= 10 && f < 20; };
  const auto excused =
      Track(6, 0, 40, {100, 300}, [](auto f) { return f >= 10 && f < 20 ? 50.0 : 0.0; });
  const auto ends_hidden = Track(7, 0, 15, {200, 300});
  const auto none = MeasureIn(40, Join({excused, ends_hidden}), Moving(hidden));
  EXPECT_EQ(none.frames, 29u + 9u);
  EXPECT_EQ(none.reinitializations, 0u);
  EXPECT_FALSE(none.mean_frames_between);

  // The clip goes on where no track does.
  const auto all_lost = MeasureIn(12, Join({lost}), Moving());
  EXPECT_EQ(all_lost.frames, 10u);
  EXPECT_EQ(all_lost.reinitializations, 1u);
  EXPECT_EQ(MeasureIn(11, Join({lost}), Moving()).reinitializations, 0u);
}

TEST(TrajectoryL1, IsSummedOverTheFramesAndGivingUpWinsNothing) {
  const auto steady = Track(1, 0, 40, {100, 300}, [](auto f) { return f == 0 ? 0.0 : -0.5; });
  auto figure = MeasureTrajectoryL1(Join({steady}), FramesUpTo(40), Moving());
  ASSERT_TRUE(figure);
  EXPECT_EQ(figure->tracks, 1u);
  EXPECT_NEAR(figure->mean_px, 30 * 0.5, 1e-9);

  // Lost after frame 28: it stays there, while the truth moves on by 3 px (L1) a frame.
  const auto lost = Track(2, 0, 29, {200, 300});
  const auto late = Track(3, 1, 40, {300, 300}, [](auto) { return 5.0; });  // not of frame 0
  const auto leaves = Track(4, 0, 15, {610, 300});  // its point leaves the image
  figure = MeasureTrajectoryL1(Join({steady, lost, late, leaves}), FramesUpTo(40), Moving());
  ASSERT_TRUE(figure);
  EXPECT_EQ(figure->tracks, 2u);
  EXPECT_NEAR(figure->mean_px, (15.0 + 3.0 + 6.0) / 2.0, 1e-9);

  // All are lost: two frames of 3 px each.
  figure = MeasureTrajectoryL1(Join({lost}), FramesUpTo(31), Moving());
  ASSERT_TRUE(figure);
  EXPECT_NEAR(figure->mean_px, 3.0 + 6.0, 1e-9);

  EXPECT_FALSE(MeasureTrajectoryL1(Join({Track(1, 0, 30, {100, 300})}), FramesUpTo(30), Moving()));
  EXPECT_FALSE(MeasureTrajectoryL1(TrackSet(), FramesUpTo(40), Moving()));
}

}  // namespace
}  // namespace cohort
