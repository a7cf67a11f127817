#pragma once

#include <cstdint>
#include <deque>
#include <opencv2/core/mat.hpp>

#include "datasets/degrade/degrade.h"
#include "frontend/core/random_stream.h"

namespace cohort {

// A phone's automatic exposure: measures the light from time to time and corrects it in thirds of a
// stop, with a delay, and never quite settles.
//   stops = round(3 log2(light of the first frame / light 0.2 s ago)) / 3 + hunting,
// updated every 0.6 to 1.4 s, at most 1.5 either way; hunting is -1/3, 0 or 1/3 and differs from
// the last update's. Random numbers: RandomStream(seed, "degrade/exposure").
class AutoExposure {
 public:
  AutoExposure(double frames_per_second, unsigned seed);

  // The stops of the next frame; `light` is the mean of its linear light.
  double NextStops(double light);

 private:
  long Period();

  RandomStream random_;
  double frames_per_second_;
  std::size_t lag_;            // frames
  std::deque<double> lights_;  // of the frames since the one that it measures
  double first_light_ = 0.0;
  long until_change_;  // frames
  int hunting_ = 0;    // thirds
  double stops_ = 0.0;
};

// Denoising in space, then in time, from the past alone (as the filter hqdn3d does it): with s the
// picture after a bilateral filter of 5 x 5 px,
//   out = s + a (out of the frame before - s),   a = 0.75 exp(-(d / (0.3 sigma))^2 / 2),
// where d is the difference in parentheses, blurred. Moving contrast thus stays, and weak texture
// is dragged along. `sigma` is the assumed noise.
class PhoneDenoiser {
 public:
  explicit PhoneDenoiser(double sigma) : sigma_(sigma) {}

  cv::Mat Next(const cv::Mat& value);  // CV_32FC1, 0..1, after gamma

 private:
  double sigma_;
  cv::Mat before_;
};

// A phone's processing of sensor measurements before encoding: digital gain and gamma, denoising,
// automatic exposure (whose steps the denoising takes into account), 8 bits.
class PhoneCamera {
 public:
  PhoneCamera(const DegradeOptions& options, double frames_per_second);

  // The next frame: takes MeasuredLight, returns CV_8UC1.
  cv::Mat Next(const cv::Mat& light);

 private:
  SensorLevel sensor_;
  AutoExposure exposure_;
  PhoneDenoiser denoiser_;
};

// The bit rate of a phone's video: 2.5 Mbit/s for 640 x 480 pixels at 30 frames a second, in
// proportion to the pixels; the same in the dark, where noise takes the bits.
int PhoneBitrateKbit(cv::Size size, double frames_per_second);

}  // namespace cohort
