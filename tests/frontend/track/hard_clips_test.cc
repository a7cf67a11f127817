// What the trackers say of clips that are hard to track, or that show nothing.

#include "tests/support/hard_clips.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <opencv2/core/utility.hpp>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "frontend/track/tracker.h"

namespace cohort {
namespace {

using test::Pictures;

// Those that say what they see, and the two that have no test of it.
std::map<std::string, TrackerOptions> Trackers() {
  std::map<std::string, TrackerOptions> trackers;
  for (const char* name : {"Klt", "AnchoredKlt", "Strong", "Weak", "Descent", "GuideAlone"}) {
    trackers[name].detector.max_features = 60;
  }
  trackers["Klt"].tracker = TrackerKind::kKlt;
  trackers["AnchoredKlt"].tracker = TrackerKind::kAnchoredKlt;
  trackers["Weak"].subspace.constraint = Constraint::kWeak;
  trackers["Descent"].tracker = TrackerKind::kDescent;
  trackers["GuideAlone"].measurement.enabled = false;
  return trackers;
}

std::vector<FrameResult> TrackAll(const TrackerOptions& options, const Pictures& pictures) {
  const auto tracker = MakeTracker(options);
  std::vector<FrameResult> results;
  for (const cv::Mat& picture : pictures) {
    Frame frame;
    frame.index = FrameIndex{static_cast<std::uint32_t>(results.size())};
    frame.gray = picture;
    results.push_back(tracker->Track(frame));
  }
  return results;
}

std::size_t Observed(const FrameResult& frame) {
  return static_cast<std::size_t>(
      std::count_if(frame.observations.begin(), frame.observations.end(), IsObserved));
}

std::map<LossReason, int> Ends(const std::vector<FrameResult>& frames) {
  std::map<LossReason, int> ends;
  for (const FrameResult& frame : frames) {
    for (const TrackEnd& end : frame.ends) ++ends[end.reason];
  }
  return ends;
}

// Of the features observed in two frames that follow each other, the share that is not where the
// picture moved, to 1 px; `moved(t)`: from frame t - 1 to t.
template <typename Moved>
double WrongShare(const std::vector<FrameResult>& frames, const Moved& moved) {
  std::size_t all = 0;
  std::size_t wrong = 0;
  std::map<FeatureId, Eigen::Vector2d> before;
  for (std::size_t t = 0; t < frames.size(); ++t) {
    std::map<FeatureId, Eigen::Vector2d> now;
    for (const Observation& o : frames[t].observations) {
      if (!IsObserved(o)) continue;
      now[o.feature] = o.xy;
      const auto last = before.find(o.feature);
      if (last == before.end()) continue;
      ++all;
      if ((o.xy - last->second - moved(t)).norm() > 1.0) ++wrong;
    }
    before = std::move(now);
  }
  return all == 0 ? 0.0 : static_cast<double>(wrong) / static_cast<double>(all);
}

Eigen::Vector2d AsItMoves(std::size_t) { return test::kMovingPx; }

// ---- what holds of every clip ----

void ExpectFiniteAndWhole(const std::vector<FrameResult>& frames, const cv::Size& size) {
  std::map<FeatureId, FrameIndex> last_seen;
  std::set<FeatureId> ended;
  for (std::size_t t = 0; t < frames.size(); ++t) {
    const FrameIndex frame{static_cast<std::uint32_t>(t)};
    for (const TrackEnd& end : frames[t].ends) {
      EXPECT_TRUE(ended.insert(end.feature).second) << "ends twice";
      EXPECT_EQ(last_seen.at(end.feature), end.last_frame);
    }
    std::size_t alive = last_seen.size() - ended.size();
    for (const Observation& o : frames[t].observations) {
      EXPECT_TRUE(o.xy.allFinite());
      EXPECT_TRUE(o.xy.x() >= 0.0 && o.xy.y() >= 0.0 && o.xy.x() <= size.width - 1 &&
                  o.xy.y() <= size.height - 1)
          << o.xy.transpose();
      EXPECT_TRUE(std::isfinite(o.residual) && o.residual >= 0.0) << o.residual;
      if (o.covariance) {
        const Eigen::Matrix2d covariance = o.covariance->Matrix();
        EXPECT_TRUE(covariance.allFinite()) << covariance;
        EXPECT_GT(covariance.determinant(), 0.0) << covariance;
      }
      EXPECT_FALSE(ended.contains(o.feature)) << "goes on behind its end";
      if (!last_seen.contains(o.feature)) ++alive;
      last_seen[o.feature] = frame;
    }
    EXPECT_EQ(frames[t].observations.size(), alive) << "every feature alive has its line";
  }
}

bool Same(const Observation& a, const Observation& b) {
  const bool covariances = a.covariance && b.covariance
                               ? a.covariance->Matrix() == b.covariance->Matrix()
                               : a.covariance.has_value() == b.covariance.has_value();
  return a.feature == b.feature && a.xy == b.xy && a.state == b.state && a.residual == b.residual &&
         covariances;
}

bool Same(const TrackEnd& a, const TrackEnd& b) {
  return a.feature == b.feature && a.last_frame == b.last_frame && a.reason == b.reason;
}

template <typename T>
bool Same(const std::vector<T>& a, const std::vector<T>& b) {
  return std::equal(
      a.begin(), a.end(), b.begin(), b.end(), [](const T& x, const T& y) { return Same(x, y); });
}

template <typename Map>
std::vector<std::string> NamesOf(const Map& map) {
  std::vector<std::string> names;
  for (const auto& [name, value] : map) names.push_back(name);
  return names;
}

class HardClip : public testing::TestWithParam<std::string> {};

TEST_P(HardClip, GivesFiniteFiguresWholeBooksAndTheSameWithTwoThreads) {
  const Pictures pictures = test::HardClips().at(GetParam())();
  for (const auto& [tracker, options] : Trackers()) {
    SCOPED_TRACE(tracker);
    cv::setNumThreads(1);
    const std::vector<FrameResult> frames = TrackAll(options, pictures);
    cv::setNumThreads(2);
    const std::vector<FrameResult> again = TrackAll(options, pictures);
    cv::setNumThreads(-1);
    ExpectFiniteAndWhole(frames, pictures.front().size());
    for (std::size_t t = 0; t < frames.size(); ++t) {
      EXPECT_TRUE(Same(frames[t].observations, again[t].observations)) << "frame " << t;
      EXPECT_TRUE(Same(frames[t].ends, again[t].ends)) << "frame " << t;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Of,
                         HardClip,
                         testing::ValuesIn(NamesOf(test::HardClips())),
                         [](const auto& info) { return info.param; });

// ---- what is said of each ----

class TrackerOfHardClips : public testing::TestWithParam<std::string> {
 protected:
  static TrackerOptions Options() { return Trackers().at(GetParam()); }
  static std::vector<FrameResult> Track(const Pictures& pictures) {
    return TrackAll(Options(), pictures);
  }
};

TEST_P(TrackerOfHardClips, WhereThereIsNothingToSeeHaveNoFeature) {
  for (const double value : {0.0, 0.5, 1.0}) {
    for (const FrameResult& frame : Track(test::EvenClip(value))) {
      EXPECT_TRUE(frame.observations.empty());
      EXPECT_TRUE(frame.ends.empty());
    }
  }
}

// Noise may look like that of another frame now and then, more often where there is nothing else.
TEST_P(TrackerOfHardClips, TakeNoiseForHardlyAFeatureAndFollowNone) {
  const std::vector<FrameResult> frames = Track(test::NoiseClip(0.1));
  std::map<FeatureId, int> times;
  for (const FrameResult& frame : frames) {
    EXPECT_LE(frame.observations.size(), 3u);
    for (const Observation& o : frame.observations) times[o.feature] += IsObserved(o) ? 1 : 0;
  }
  for (const auto& [feature, count] : times) {
    EXPECT_LT(2 * count, static_cast<int>(frames.size())) << "feature " << ToInt(feature);
  }
}

TEST_P(TrackerOfHardClips, StayWhereNothingMoves) {
  const std::vector<FrameResult> frames = Track(test::StaticClip());
  EXPECT_GT(Observed(frames.front()), 50u);
  for (std::size_t t = 1; t < frames.size(); ++t) {
    EXPECT_EQ(Observed(frames[t]), Observed(frames.front()));
    for (std::size_t f = 0; f < frames[t].observations.size(); ++f) {
      const Observation& then = frames.front().observations[f];
      EXPECT_LT((frames[t].observations[f].xy - then.xy).norm(), 0.01);
    }
  }
}

TEST_P(TrackerOfHardClips, GoOnWhereTheCameraSetsOut) {
  const std::vector<FrameResult> frames =
      Track(test::Joined(Pictures(8, test::MovingClip().front()), test::MovingClip(0.0, 8, 1)));
  EXPECT_EQ(
      WrongShare(frames,
                 [](std::size_t t) { return t < 8 ? Eigen::Vector2d(0, 0) : test::kMovingPx; }),
      0.0);
  EXPECT_GT(Observed(frames.back()), 40u);
}

TEST_P(TrackerOfHardClips, FollowARepeatedPatternThatMovesByLessThanHalfOfIt) {
  const std::vector<FrameResult> frames = Track(test::ChessboardClip());
  EXPECT_GT(Observed(frames.back()), 40u);
  EXPECT_EQ(WrongShare(frames, [](std::size_t) { return Eigen::Vector2d(3, 0); }), 0.0);
}

TEST_P(TrackerOfHardClips, FollowATurningCameraAndAPlane) {
  for (const Pictures& clip : {test::TurningClip(), test::PlaneOnlyClip()}) {
    const std::vector<FrameResult> frames = Track(clip);
    EXPECT_GT(Observed(frames.front()), 50u);
    EXPECT_GT(Observed(frames.back()), Observed(frames.front()) * 9 / 10);
    for (const auto& [reason, count] : Ends(frames)) EXPECT_EQ(reason, LossReason::kLeftImage);
  }
}

TEST_P(TrackerOfHardClips, FollowFeaturesOnALineAndFewerThanTheRank) {
  const std::vector<FrameResult> line = Track(test::LineOfDotsClip());
  const std::vector<FrameResult> two = Track(test::TwoDotsClip());
  for (std::size_t t = 0; t < line.size(); ++t) {
    ASSERT_EQ(Observed(line[t]), 9u);
    ASSERT_EQ(Observed(two[t]), 2u);
  }
  EXPECT_EQ(WrongShare(line, [](std::size_t) { return Eigen::Vector2d(0.8, 0.4); }), 0.0);
  EXPECT_EQ(WrongShare(two, [](std::size_t) { return Eigen::Vector2d(1.2, 0.15); }), 0.0);
}

TEST_P(TrackerOfHardClips, SayTheSameOfTwoFeaturesInOnePlace) {
  const Pictures pictures = test::MovingClip();
  const auto mover = MakeMover(Options());
  const std::vector<Eigen::Vector2d> once{
      {40, 40}, {60, 44}, {80, 40}, {100, 44}, {120, 40}, {50, 80}, {70, 84}, {90, 80}, {110, 84}};
  std::vector<Eigen::Vector2d> twice = once;
  twice.insert(twice.end(), once.begin(), once.end());
  mover->Add(twice, BuildPyramid(pictures[0]));
  for (std::size_t t = 1; t < pictures.size(); ++t) {
    const std::vector<Move> moves = mover->MoveFeatures(BuildPyramid(pictures[t]));
    mover->Keep(std::vector<std::uint8_t>(twice.size(), 1));
    for (std::size_t f = 0; f < once.size(); ++f) {
      const Move& twin = moves[once.size() + f];
      EXPECT_TRUE(moves[f].xy.allFinite());
      EXPECT_LT((moves[f].xy - twin.xy).norm(), 1e-3);
      EXPECT_EQ(moves[f].state, twin.state);
      EXPECT_EQ(moves[f].loss, twin.loss);
      const Eigen::Vector2d true_xy = once[f] + static_cast<double>(t) * test::kMovingPx;
      EXPECT_TRUE(moves[f].loss || (moves[f].xy - true_xy).norm() < 0.5);
    }
  }
}

TEST_P(TrackerOfHardClips, AreNotMisledByFramesDroppedRepeatedOrSwapped) {
  const Pictures moving = test::MovingClip(0.0, 14);
  for (const std::vector<int>& order : {std::vector<int>{0, 1, 2, 6, 7, 8, 12, 13},
                                        std::vector<int>{0, 1, 1, 1, 2, 3, 3, 4},
                                        std::vector<int>{0, 2, 1, 4, 3, 6, 5, 7}}) {
    const std::vector<FrameResult> frames = Track(test::Reordered(moving, order));
    EXPECT_GE(Observed(frames.back()), 50u);
    for (const auto& [reason, count] : Ends(frames)) EXPECT_EQ(reason, LossReason::kLeftImage);
    EXPECT_EQ(WrongShare(frames,
                         [&](std::size_t t) -> Eigen::Vector2d {
                           return (order[t] - order[t - 1]) * test::kMovingPx;
                         }),
              0.0);
  }
}

TEST_P(TrackerOfHardClips, LetGoRatherThanErrWhereTheLightJumps) {
  for (const double gain : {0.35, 1.8}) {
    const std::vector<FrameResult> frames = Track(test::ExposedAnew(test::MovingClip(), 4, gain));
    EXPECT_LT(WrongShare(frames, AsItMoves), 0.01) << gain;
    EXPECT_GE(Observed(frames.back()), 45u) << gain;
  }
}

TEST_P(TrackerOfHardClips, HoldTheirFeaturesThroughAFrameThatShowsNothing) {
  for (const double value : {0.0, 1.0}) {
    const std::vector<FrameResult> frames = Track(test::FrameLostClip(value));
    EXPECT_EQ(frames[4].observations.size(), frames[3].observations.size());
    EXPECT_EQ(Observed(frames[4]), 0u);
    EXPECT_GE(Observed(frames[5]), 50u);
    for (const auto& [reason, count] : Ends(frames)) EXPECT_EQ(reason, LossReason::kLeftImage);
    EXPECT_EQ(WrongShare(frames, AsItMoves), 0.0);
  }
}

TEST_P(TrackerOfHardClips, GiveUpFeaturesThatAreHeldForTooLong) {
  const Pictures black(30, test::EvenClip(0.0).front());
  const std::vector<FrameResult> frames = Track(test::Joined(test::MovingClip(0.0, 4), black));
  EXPECT_EQ(frames[23].observations.size(), frames[3].observations.size());
  EXPECT_TRUE(frames[24].observations.empty());
  EXPECT_EQ(Ends(frames).size(), 1u);
  EXPECT_TRUE(Ends(frames).contains(LossReason::kContradicted));
}

// The first of each scene after the first one.
std::vector<std::size_t> CutsOf(const std::vector<FrameResult>& frames) {
  std::vector<std::size_t> cuts;
  for (std::size_t t = 0; t < frames.size(); ++t) {
    if (frames[t].cut) cuts.push_back(t);
  }
  return cuts;
}

TEST_P(TrackerOfHardClips, EndAllTracksAtACutAndBeginAnew) {
  for (const auto& [clip, cuts] : {std::pair("Cut", std::vector<std::size_t>{5}),
                                   std::pair("TwoScenesInTurn", std::vector<std::size_t>{3, 6})}) {
    const std::vector<FrameResult> frames = Track(test::HardClips().at(clip)());
    EXPECT_EQ(CutsOf(frames), cuts);
    for (const std::size_t cut : cuts) {
      ASSERT_EQ(frames[cut].ends.size(), frames[cut - 1].observations.size());
      for (const TrackEnd& end : frames[cut].ends) {
        EXPECT_EQ(end.reason, LossReason::kCut);
        EXPECT_EQ(ToInt(end.last_frame), cut - 1);
      }
      const FeatureId first_born = frames[cut].observations.front().feature;
      EXPECT_GT(first_born, frames[cut - 1].observations.back().feature);
      EXPECT_EQ(Observed(frames[cut]), frames[cut].observations.size());
      EXPECT_GE(Observed(frames[cut + 1]), 50u);
    }
    EXPECT_EQ(WrongShare(frames, AsItMoves), 0.0);
  }
}

TEST_P(TrackerOfHardClips, LookForFeaturesBehindACutThoughTheyNeverDoElse) {
  TrackerOptions options = Options();
  options.detector.redetect_below = 0.0;
  const std::vector<FrameResult> frames = TrackAll(options, test::HardClips().at("Cut")());
  EXPECT_GE(Observed(frames.back()), 50u);
}

TEST_P(TrackerOfHardClips, GoAcrossACutIfAskedTo) {
  TrackerOptions options = Options();
  options.cuts = false;
  const std::vector<FrameResult> frames = TrackAll(options, test::HardClips().at("Cut")());
  EXPECT_TRUE(CutsOf(frames).empty());
  EXPECT_FALSE(Ends(frames).contains(LossReason::kCut));
}

INSTANTIATE_TEST_SUITE_P(All,
                         TrackerOfHardClips,
                         testing::Values("Klt", "AnchoredKlt", "Strong", "Weak"),
                         [](const auto& info) { return info.param; });

TEST(SubspaceTrackerOfHardClips, KeepsItsFeaturesWhereTheLightFalls) {
  for (const char* tracker : {"Strong", "Weak"}) {
    const std::vector<FrameResult> frames =
        TrackAll(Trackers().at(tracker), test::ExposedAnew(test::MovingClip(), 4, 0.35));
    EXPECT_EQ(Observed(frames[4]), Observed(frames[3])) << tracker;
    EXPECT_FALSE(Ends(frames).contains(LossReason::kContradicted)) << tracker;
  }
}

// Half the light from frame 6 on, and from frame 12 another scene of less contrast than a step of 8
// bits: a picture whose light was changed has the steps that it was decoded with.
TEST(SubspaceTrackerOfHardClips, FindsACutIntoADarknessOfSixteenBitsInAnotherLight) {
  Pictures clip = test::Joined(test::MovingClip(0.0, 12), test::MovingClip(4000.0, 8));
  for (std::size_t t = 0; t < clip.size(); ++t) {
    if (t < 12) {
      clip[t].convertTo(clip[t], CV_16U, t < 6 ? 257.0 : 128.5);
    } else {
      clip[t].convertTo(clip[t], CV_16U, 1.0, 200.0);
    }
  }
  for (const char* tracker : {"Strong", "Weak"}) {
    const std::vector<FrameResult> frames = TrackAll(Trackers().at(tracker), clip);
    // One later: of so dark a frame the next one tells whether it is blank.
    EXPECT_EQ(CutsOf(frames), std::vector<std::size_t>{13}) << tracker;
    EXPECT_GE(Observed(frames.back()), 50u) << tracker;
  }
}

// ---- pictures of any size and depth ----

TEST(TrackersOfAnyPicture, PicturesOfAFewPixelsHaveNoFeatures) {
  for (const auto& [name, options] : Trackers()) {
    for (const cv::Size size : {cv::Size(1, 1),
                                cv::Size(2, 3),
                                cv::Size(15, 16),
                                cv::Size(31, 17),
                                cv::Size(32, 32),
                                cv::Size(600, 1),
                                cv::Size(1, 600),
                                cv::Size(5, 300)}) {
      const Pictures pictures{test::SpotsImage(size.width, size.height, 0, 0),
                              test::SpotsImage(size.width, size.height, 1, 0),
                              test::SpotsImage(size.width, size.height, 2, 0)};
      for (const FrameResult& frame : TrackAll(options, pictures)) {
        EXPECT_TRUE(frame.observations.empty()) << name << ", " << size;
      }
    }
  }
}

TEST(TrackersOfAnyPicture, AFeatureOfASmallPictureIsFollowed) {
  Pictures pictures;
  for (int t = 0; t < 4; ++t) {
    pictures.push_back(test::ImageOf(
        [&](double x, double y) {
          return test::DotsAt(x, y, {{19 + 0.5 * t, 20.0}});
        },
        40,
        41,
        CV_8U));
  }
  for (const auto& [name, options] : Trackers()) {
    const std::vector<FrameResult> frames = TrackAll(options, pictures);
    ExpectFiniteAndWhole(frames, pictures.front().size());
    EXPECT_EQ(Observed(frames.back()), 1u) << name;
    EXPECT_EQ(WrongShare(frames, [](std::size_t) { return Eigen::Vector2d(0.5, 0); }), 0.0) << name;
  }
}

TEST(TrackersOfAnyPicture, SixteenBitsAreFollowedLikeEight) {
  const Pictures eight = test::MovingClip(0.0, 5);
  Pictures sixteen;
  for (const cv::Mat& picture : eight) picture.convertTo(sixteen.emplace_back(), CV_16U, 257.0);
  for (const auto& [name, options] : Trackers()) {
    const std::vector<FrameResult> a = TrackAll(options, eight);
    const std::vector<FrameResult> b = TrackAll(options, sixteen);
    for (std::size_t t = 0; t < a.size(); ++t) {
      ASSERT_EQ(a[t].observations.size(), b[t].observations.size()) << name;
      for (std::size_t f = 0; f < a[t].observations.size(); ++f) {
        const Observation& of_eight = a[t].observations[f];
        const Observation& of_sixteen = b[t].observations[f];
        EXPECT_LT((of_eight.xy - of_sixteen.xy).norm(), 0.01) << name;
        EXPECT_EQ(of_eight.state, of_sixteen.state) << name;
      }
    }
  }
}

// A contrast of 50 of 65535: less than a step of 8 bits is something, where there are 16. From
// frame 6 on in half the light.
TEST(SubspaceTrackerOfHardClips, FollowsWhatOnlySixteenBitsShow) {
  const Pictures bright = test::MovingClip();
  Pictures dim(bright.size());
  for (std::size_t t = 0; t < bright.size(); ++t) {
    bright[t].convertTo(dim[t], CV_16U, t < 6 ? 0.4 : 0.2, 20000.0);
  }
  for (const char* tracker : {"Strong", "Weak"}) {
    const std::vector<FrameResult> frames = TrackAll(Trackers().at(tracker), dim);
    ExpectFiniteAndWhole(frames, bright.front().size());
    EXPECT_GE(Observed(frames.back()), 50u) << tracker;
    EXPECT_LT(WrongShare(frames, AsItMoves), 0.01) << tracker;
  }
}

}  // namespace
}  // namespace cohort
