#include "frontend/track/second_look.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "frontend/core/random_stream.h"
#include "tests/support/closed_form_image.h"

namespace cohort {
namespace {

constexpr int kFrames = 12;
constexpr int kOccluded = 7;  // in this frame a flat bar hides the left half

Eigen::Vector2d Shift(int frame) { return {1.3 * frame, -0.7 * frame}; }

// A picture that moves by Shift, darkened and with noise.
Frame NoisyFrame(int i) {
  cv::Mat picture;
  test::WavesImage(320, 240, Shift(i).x(), Shift(i).y()).convertTo(picture, CV_32F, 0.3 / 255.0);
  RandomStream random(1, "second_look_test/" + std::to_string(i));
  for (int y = 0; y < picture.rows; ++y) {
    for (int x = 0; x < picture.cols; ++x) {
      picture.at<float>(y, x) += static_cast<float>(0.05 * random.Gaussian());
    }
  }
  if (i == kOccluded) picture.colRange(0, 160).setTo(0.15F);
  Frame frame;
  frame.index = FrameIndex{static_cast<std::uint32_t>(i)};
  frame.gray = picture;
  return frame;
}

std::vector<Eigen::Vector2d> Features() {
  std::vector<Eigen::Vector2d> features;
  for (int y = 60; y <= 200; y += 35) {
    for (int x = 40; x <= 280; x += 40) features.emplace_back(x, y);
  }
  return features;
}

// Guides that are `error` off; the first pass saw the features in the first half of the clip.
std::vector<Guide> GuidesIn(int frame, const Eigen::Vector2d& error) {
  std::vector<Guide> guides;
  std::uint32_t id = 0;
  for (const Eigen::Vector2d& xy : Features()) {
    guides.push_back({FeatureId{id++},
                      xy + Shift(frame) + error,
                      Eigen::Matrix2d::Identity(),
                      frame < kFrames / 2});
  }
  return guides;
}

std::vector<Observation> Look(const SecondLookOptions& options) {
  SecondLook look(options);
  for (int i = 2; i < 2 + options.template_frames; ++i) {
    look.Learn(NoisyFrame(i), GuidesIn(i, {0, 0}));
  }
  for (int i = 0; i < kFrames; ++i) look.Measure(NoisyFrame(i), GuidesIn(i, {0.6, -0.4}));
  return look.Finish();
}

double Rms(const std::vector<Observation>& observations) {
  double sum = 0.0;
  for (const Observation& o : observations) {
    sum += (o.xy - Features()[ToInt(o.feature)] - Shift(static_cast<int>(ToInt(o.frame))))
               .squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(observations.size()));
}

TEST(SecondLook, FindsWhatTheFirstPassLostAndNotWhatIsHidden) {
  const std::vector<Observation> observations = Look({});
  std::vector<int> found(kFrames);
  int behind_the_bar = 0;
  for (const Observation& o : observations) {
    ++found[ToInt(o.frame)];
    if (ToInt(o.frame) == kOccluded && o.xy.x() < 145) ++behind_the_bar;
    ASSERT_TRUE(o.covariance);
  }
  EXPECT_EQ(behind_the_bar, 0);
  const int all = static_cast<int>(Features().size());
  for (int i = 0; i < kFrames; ++i) {
    EXPECT_GT(found[i], i == kOccluded ? all / 3 : all * 9 / 10) << "frame " << i;
  }
  EXPECT_LT(Rms(observations), 0.4);
}

TEST(SecondLook, AMeanOfFramesIsABetterTemplateThanOneFrame) {
  SecondLookOptions one;
  one.template_frames = 1;
  EXPECT_LT(Rms(Look({})), 0.9 * Rms(Look(one)));
}

TEST(SecondLook, CovariancesHaveTheSizeOfTheErrors) {
  double squares = 0.0;
  std::size_t count = 0;
  for (const Observation& o : Look({})) {
    const Eigen::Vector2d d =
        o.xy - Features()[ToInt(o.feature)] - Shift(static_cast<int>(ToInt(o.frame)));
    Eigen::Matrix2d covariance;
    covariance << o.covariance->xx, o.covariance->xy, o.covariance->xy, o.covariance->yy;
    squares += d.dot(covariance.inverse() * d);
    ++count;
  }
  // Of chi-square with two degrees of freedom the mean is 2. The guides' own errors count as the
  // measurements', so the covariances are rather too large.
  const double mean = squares / static_cast<double>(count);
  EXPECT_LT(mean, 2.0);
  EXPECT_GT(mean, 0.1);
}

}  // namespace
}  // namespace cohort
