// A phone between sensor and encoder: exposure in steps, denoising from the past.
#include "datasets/degrade/phone_camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

#include "tests/support/closed_form_image.h"

namespace cohort {
namespace {

// Stops of every frame at 30 a second; the light is halved from `darker_from` on.
std::vector<double> Stops(unsigned seed, int darker_from) {
  AutoExposure exposure(30.0, seed);
  std::vector<double> stops;
  for (int frame = 0; frame < 400; ++frame) {
    stops.push_back(exposure.NextStops(frame < darker_from ? 0.02 : 0.01));
  }
  return stops;
}

TEST(AutoExposure, ChangesInThirdsOfAStopEverySecondOrSo) {
  const std::vector<double> stops = Stops(1, 1000);
  EXPECT_EQ(stops[0], 0.0);
  int last = 0;
  int changes = 0;
  for (int frame = 1; frame < 400; ++frame) {
    const auto i = static_cast<std::size_t>(frame);
    const double thirds = 3.0 * (stops[i] - stops[i - 1]);
    EXPECT_NEAR(thirds, std::round(thirds), 1e-9);
    if (thirds == 0.0) continue;
    EXPECT_GE(frame - last, 18);
    EXPECT_LE(frame - last, 42);
    last = frame;
    ++changes;
  }
  EXPECT_GE(changes, 9);
  EXPECT_EQ(stops, Stops(1, 1000));
  EXPECT_NE(stops, Stops(2, 1000));
}

// It looks at the light of six frames ago, and only when it changes.
TEST(AutoExposure, FollowsTheLightLate) {
  const std::vector<double> even = Stops(1, 1000);
  const std::vector<double> darker = Stops(1, 100);
  for (std::size_t frame = 0; frame < 400; ++frame) {
    if (frame < 106) {
      EXPECT_EQ(darker[frame], even[frame]) << frame;
    } else if (frame >= 106 + 42) {
      EXPECT_NEAR(darker[frame], even[frame] + 1.0, 1e-9) << frame;
    }
  }
}

cv::Mat Noisy(const cv::Mat& clean, double sigma, std::uint64_t frame) {
  RandomStream random = RandomStream(1, "test").Fork(frame);
  cv::Mat noisy = clean.clone();
  for (float& v : cv::Mat_<float>(noisy)) v += static_cast<float>(sigma * random.Gaussian());
  return noisy;
}

cv::Mat Spots(double dx) {
  cv::Mat spots;
  test::SpotsImage(200, 160, dx, 0.0, CV_16U).convertTo(spots, CV_32F, 1.0 / 65535.0);
  return spots;
}

double RmsDifference(const cv::Mat& a, const cv::Mat& b) {
  return cv::norm(a, b, cv::NORM_L2) / std::sqrt(static_cast<double>(a.total()));
}

TEST(PhoneDenoiser, TakesNoiseAwayInSpaceAndTime) {
  constexpr double kSigma = 0.03;
  const cv::Mat clean = Spots(0.0);
  PhoneDenoiser denoiser(kSigma);
  const cv::Mat first = denoiser.Next(Noisy(clean, kSigma, 0));
  cv::Mat last;
  for (std::uint64_t frame = 1; frame < 20; ++frame) {
    last = denoiser.Next(Noisy(clean, kSigma, frame));
  }
  EXPECT_LT(RmsDifference(first, clean), 0.6 * kSigma);
  EXPECT_LT(RmsDifference(last, clean), 0.9 * RmsDifference(first, clean));
}

// What stands still stays where it is: no direction is favoured. The upside-down clip is denoised
// to the upside-down pictures.
TEST(PhoneDenoiser, DisplacesNothingThatStandsStill) {
  constexpr double kSigma = 0.03;
  const auto upside_down = [](const cv::Mat& picture) {
    cv::Mat flipped;
    cv::flip(picture, flipped, -1);
    return flipped;
  };
  PhoneDenoiser denoiser(kSigma);
  PhoneDenoiser other(kSigma);
  for (std::uint64_t frame = 0; frame < 5; ++frame) {
    const cv::Mat noisy = Noisy(Spots(0.0), kSigma, frame);
    const cv::Mat one = denoiser.Next(noisy);
    EXPECT_LT(RmsDifference(one, upside_down(other.Next(upside_down(noisy)))), 1e-5);
  }
}

// Strong contrast that moves leaves no ghost; contrast below the noise is dragged along.
TEST(PhoneDenoiser, WhatIsFaintLagsBehindWhatIsStrongDoesNot) {
  constexpr double kSigma = 0.05;
  const auto lag = [&](double contrast) {
    PhoneDenoiser denoiser(kSigma);
    cv::Mat out;
    const auto edge = [&](int x) {
      cv::Mat picture(60, 120, CV_32F, cv::Scalar(0.3));
      picture.colRange(0, x) = cv::Scalar(0.3 + contrast);
      return picture;
    };
    for (int frame = 0; frame < 8; ++frame) out = denoiser.Next(edge(40 + 4 * frame));
    return RmsDifference(out, edge(68)) / contrast;
  };
  EXPECT_GT(lag(0.01), 2.0 * lag(0.5));
}

TEST(PhoneCamera, BrightensByTheGainOfItsExposure) {
  DegradeOptions options;
  options.recipe = DegradeRecipe::kPhone;
  options.level = 1.0;
  const SensorLevel sensor = SensorLevelAt(1.0);
  PhoneCamera camera(options, 30.0);
  AutoExposure exposure(30.0, options.seed);
  const cv::Mat light(20, 20, CV_32F, cv::Scalar(0.02));
  for (int frame = 0; frame < 120; ++frame) {
    const double stops = exposure.NextStops(cv::mean(light)[0]);
    const double expected = std::pow(0.02 * sensor.digital_gain * std::exp2(stops), 1.0 / 2.2);
    EXPECT_NEAR(cv::mean(camera.Next(light))[0], 255.0 * expected, 0.51) << frame;
  }
}

TEST(PhoneBitrate, IsTwoAndAHalfMegabitForAVgaVideo) {
  EXPECT_EQ(PhoneBitrateKbit({640, 480}, 30.0), 2500);
  EXPECT_EQ(PhoneBitrateKbit({1280, 960}, 15.0), 5000);
  EXPECT_EQ(PhoneBitrateKbit({1, 1}, 1.0), 1);
}

}  // namespace
}  // namespace cohort
