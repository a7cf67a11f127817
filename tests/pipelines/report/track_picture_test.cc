#include "pipelines/report/track_picture.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

namespace cohort {
namespace {

// A surface that moves 2 px to the right a frame.
class MovingTruth final : public TrackTruth {
 public:
  std::optional<Anchor> Pick(FrameIndex frame, const Eigen::Vector2d& xy) override {
    return Anchor{frame, {xy.x(), xy.y(), 1.0}, {}};
  }
  std::optional<TruePosition> Locate(const Anchor& anchor, FrameIndex frame) override {
    const double frames = static_cast<double>(ToInt(frame)) - ToInt(anchor.frame);
    return TruePosition{
        anchor.x_in_world.head<2>() + Eigen::Vector2d(2.0 * frames, 0.0), true, true};
  }
  bool IsOnDepthEdge(FrameIndex, const Eigen::Vector2d&, double) override { return false; }
};

// Feature f in two frames, `error_px` below the truth in the second.
std::vector<Observation> Track(std::uint32_t f, double error_px, ObservationState state) {
  const Eigen::Vector2d start(20.0, 20.0 + 20.0 * f);
  return {{FeatureId{f}, FrameIndex{0}, start},
          {FeatureId{f}, FrameIndex{1}, start + Eigen::Vector2d(2.0, error_px), state}};
}

TrackSet FourTracks() {
  std::vector<Observation> all;
  for (const auto& track : {Track(0, 0.5, ObservationState::kObserved),
                            Track(1, 2.0, ObservationState::kObserved),
                            Track(2, 4.0, ObservationState::kObserved),
                            Track(3, 0.0, ObservationState::kPredicted)}) {
    all.insert(all.end(), track.begin(), track.end());
  }
  return TrackSet::Build(std::move(all));
}

const cv::Mat kPicture(120, 160, CV_8UC3, cv::Scalar::all(7));
constexpr FrameIndex kSecond{1};

TEST(TrackPicture, CountsAndColoursBySizeOfTheError) {
  MovingTruth truth;
  const TrackPicture picture = DrawTracks(kPicture, kSecond, FourTracks(), &truth);
  EXPECT_EQ(picture.observed, 3u);
  EXPECT_EQ(picture.predicted, 1u);
  EXPECT_EQ(picture.known, 3u);
  EXPECT_EQ(picture.near_truth, 1u);
  EXPECT_EQ(picture.far, 1u);
  const auto at = [&](int x, int y) { return picture.picture.at<cv::Vec3b>(y, x); };
  const cv::Vec3b near = at(24, 21);  // beside the cross of the true position
  const cv::Vec3b far = at(22, 66);
  EXPECT_GT(near[1], near[2] + 50);                                         // green
  EXPECT_GT(far[2], far[1] + 50);                                           // red
  for (const int channel : {0, 1, 2}) EXPECT_GT(at(22, 80)[channel], 240);  // a cross in a ring
}

TEST(TrackPicture, WithoutTruthNothingIsJudged) {
  const TrackPicture picture = DrawTracks(kPicture, kSecond, FourTracks(), nullptr);
  EXPECT_EQ(picture.observed, 3u);
  EXPECT_EQ(picture.known, 0u);
  EXPECT_EQ(picture.near_truth, 0u);
  EXPECT_EQ(picture.far, 0u);
}

TEST(TrackPicture, ATailIsOfTheLastEightFramesOfTheTracks) {
  for (const std::uint32_t stride : {1U, 10U}) {
    std::vector<Observation> track;
    for (std::uint32_t i = 0; i <= 10; ++i) {
      track.push_back({FeatureId{0}, FrameIndex{stride * i}, {10.0 + 10.0 * i, 50.0}});
    }
    const FrameIndex last = track.back().frame;
    const TrackPicture picture = DrawTracks(kPicture, last, TrackSet::Build(track), nullptr);
    const auto drawn = [&](int x) { return picture.picture.at<cv::Vec3b>(50, x)[0] > 100; };
    EXPECT_TRUE(drawn(25)) << stride;
    EXPECT_FALSE(drawn(15)) << stride;
  }
}

TEST(TrackPicture, TheDataUriHoldsTheJpeg) {
  for (const int width : {30, 31, 32, 33}) {  // every length of the last group
    const std::string uri = JpegDataUri(cv::Mat(20, width, CV_8UC3, cv::Scalar(10, 200, 30)));
    const std::string head = "data:image/jpeg;base64,";
    ASSERT_EQ(uri.rfind(head, 0), 0u);
    const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::vector<std::uint8_t> bytes;
    std::uint32_t bits = 0;
    int count = 0;
    for (const char c : uri.substr(head.size())) {
      if (c == '=') break;
      bits = bits << 6 | static_cast<std::uint32_t>(digits.find(c));
      count += 6;
      if (count >= 8) bytes.push_back(static_cast<std::uint8_t>(bits >> (count -= 8)));
    }
    EXPECT_EQ((uri.size() - head.size()) % 4, 0u);
    const cv::Mat picture = cv::imdecode(bytes, cv::IMREAD_COLOR);
    ASSERT_EQ(picture.size(), cv::Size(width, 20));
    EXPECT_NEAR(picture.at<cv::Vec3b>(10, 10)[1], 200, 5);
  }
}

}  // namespace
}  // namespace cohort
