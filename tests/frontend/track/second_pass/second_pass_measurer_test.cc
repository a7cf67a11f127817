#include "frontend/track/second_pass/second_pass_measurer.h"

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
  RandomStream random(1, "second_pass_measurer_test/" + std::to_string(i));
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

// Predictions that are `error` off; the first pass saw the features in the first half of the clip.
std::vector<ModelPrediction> PredictionsIn(int frame, const Eigen::Vector2d& error) {
  std::vector<ModelPrediction> predictions;
  std::uint32_t id = 0;
  for (const Eigen::Vector2d& xy : Features()) {
    predictions.push_back({FeatureId{id++},
                           xy + Shift(frame) + error,
                           Eigen::Matrix2d::Identity(),
                           frame < kFrames / 2});
  }
  return predictions;
}

SecondPassMeasurementOptions TemplatesOf(int frames) {
  SecondPassMeasurementOptions options;
  options.template_frames = frames;
  return options;
}

std::vector<Observation> MeasureClip(const SecondPassMeasurementOptions& options = TemplatesOf(5),
                                     const Eigen::Vector2d& prediction_error = {0.6, -0.4}) {
  SecondPassMeasurer measurer(options);
  const auto is_learnt = [&](int i) { return i >= 2 && i < 2 + options.template_frames; };
  const auto predictions = [&](int i) {
    return PredictionsIn(i, is_learnt(i) ? Eigen::Vector2d(0, 0) : prediction_error);
  };
  for (int i = 0; i < kFrames; ++i) {
    if (is_learnt(i)) measurer.Learn(NoisyFrame(i), predictions(i));
  }
  for (int i = 0; i < kFrames; ++i) measurer.Measure(NoisyFrame(i), predictions(i));
  return measurer.Finish();
}

double Rms(const std::vector<Observation>& observations) {
  double sum = 0.0;
  for (const Observation& o : observations) {
    sum += (o.xy - Features()[ToInt(o.feature)] - Shift(static_cast<int>(ToInt(o.frame))))
               .squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(observations.size()));
}

TEST(SecondPassMeasurer, FindsWhatTheFirstPassLostAndNotWhatIsHidden) {
  const std::vector<Observation> observations = MeasureClip();
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

TEST(SecondPassMeasurer, AMeanOfFramesIsABetterTemplateThanOneFrame) {
  EXPECT_LT(Rms(MeasureClip()), 0.9 * Rms(MeasureClip(TemplatesOf(1))));
}

// One frame of the templates is predicted a pixel off, in the dark. Its own noise, which is in the
// mean, is where it was predicted, and would hold it there.
TEST(SecondPassMeasurer, NoFrameIsHeldByItsOwnNoiseWhereItWasPredicted) {
  constexpr int kOff = 4;
  const Eigen::Vector2d error(1.0, 0.0);
  const auto dark = [](int i) {
    Frame frame = NoisyFrame(i);
    RandomStream random(1, "second_pass_measurer_test/dark/" + std::to_string(i));
    for (float& value : cv::Mat_<float>(frame.gray)) {
      value += static_cast<float>(0.15 * random.Gaussian());
    }
    return frame;
  };
  const auto predictions = [&](int i) {
    return PredictionsIn(i, i == kOff ? error : Eigen::Vector2d(0, 0));
  };
  SecondPassMeasurer measurer(TemplatesOf(5));
  for (int i = 2; i < 7; ++i) measurer.Learn(dark(i), predictions(i));
  for (int i = 2; i < 7; ++i) measurer.Measure(dark(i), predictions(i));
  double sum = 0.0;
  int count = 0;
  for (const Observation& o : measurer.Finish()) {
    if (ToInt(o.frame) != kOff) continue;
    sum += o.xy.x() - Features()[ToInt(o.feature)].x() - Shift(kOff).x();
    ++count;
  }
  ASSERT_GT(count, 10);
  EXPECT_LT(sum / count, 0.3) << "of 1 px that the predictions are off";
}

// In the dark. The right half of the picture is noise alone, which somewhere near each prediction
// looks a little like its template.
TEST(SecondPassMeasurer, NoiseIsNoFeature) {
  const auto half_noise = [](int i) {
    Frame frame = NoisyFrame(i);
    frame.gray.colRange(160, frame.gray.cols) = 0.15F;
    RandomStream random(1, "second_pass_measurer_test/half/" + std::to_string(i));
    for (float& value : cv::Mat_<float>(frame.gray)) {
      value += static_cast<float>(0.3 * random.Gaussian());
    }
    return frame;
  };
  SecondPassMeasurer measurer(TemplatesOf(5));
  const auto predictions = [](int i) { return PredictionsIn(i, {0, 0}); };
  for (int i = 2; i < 7; ++i) measurer.Learn(half_noise(i), predictions(i));
  for (int i = 0; i < kFrames; ++i) {
    if (i != kOccluded) measurer.Measure(half_noise(i), predictions(i));
  }
  int of_noise = 0;
  int of_picture = 0;
  for (const Observation& o : measurer.Finish()) {
    const double x = Features()[ToInt(o.feature)].x();
    if (x < 125) ++of_picture;
    if (x > 195) ++of_noise;
  }
  EXPECT_LT(10 * of_noise, of_picture);
  EXPECT_GT(of_picture, 60);
}

TEST(SecondPassMeasurer, ALargerPatchHasLessNoiseAndIsTakenWhereItAgrees) {
  SecondPassMeasurementOptions narrow = TemplatesOf(5);
  narrow.patch.wide_window_px = narrow.patch.window_px;
  EXPECT_LT(Rms(MeasureClip()), 0.9 * Rms(MeasureClip(narrow)));
}

// Left and right halves of the picture move differently: where they meet, a large patch follows
// neither.
TEST(SecondPassMeasurer, ASmallPatchIsTakenWhereALargeOneShowsWhatMovesOtherwise) {
  constexpr double kEdge = 160.5;
  const Eigen::Vector2d feature(kEdge - 13.0, 120.0);  // 13 px: within 15, not within 10
  const auto frame = [&](int i) {
    Frame f;
    f.index = FrameIndex{static_cast<std::uint32_t>(i)};
    test::WavesImage(320, 240, 0.0, 0.0).convertTo(f.gray, CV_32F, 1.0 / 255.0);
    cv::Mat right;
    test::WavesImage(320, 240, 1.5 * i, 0.8 * i).convertTo(right, CV_32F, 1.0 / 255.0);
    right.colRange(161, 320).copyTo(f.gray.colRange(161, 320));
    return f;
  };
  const std::vector<ModelPrediction> predictions{
      {FeatureId{0}, feature, Eigen::Matrix2d::Identity(), true}};
  SecondPassMeasurer measurer(TemplatesOf(1));
  measurer.Learn(frame(0), predictions);
  for (int i = 0; i < kFrames; ++i) measurer.Measure(frame(i), predictions);
  const std::vector<Observation> observations = measurer.Finish();
  ASSERT_GE(observations.size(), 6u);
  for (const Observation& o : observations) EXPECT_LT((o.xy - feature).norm(), 0.1);
}

TEST(SecondPassMeasurer, CovariancesHaveTheSizeOfTheErrors) {
  double squares = 0.0;
  std::size_t count = 0;
  for (const Observation& o : MeasureClip(TemplatesOf(5), {0.1, -0.1})) {
    const Eigen::Vector2d d =
        o.xy - Features()[ToInt(o.feature)] - Shift(static_cast<int>(ToInt(o.frame)));
    Eigen::Matrix2d covariance;
    covariance << o.covariance->xx, o.covariance->xy, o.covariance->xy, o.covariance->yy;
    squares += d.dot(covariance.inverse() * d);
    ++count;
  }
  // Of chi-square with two degrees of freedom the mean is 2. The predictions' own errors count as
  // the measurements', so the covariances are rather too large.
  const double mean = squares / static_cast<double>(count);
  EXPECT_LT(mean, 2.0);
  EXPECT_GT(mean, 0.7);
}

}  // namespace
}  // namespace cohort
