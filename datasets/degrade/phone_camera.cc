#include "datasets/degrade/phone_camera.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace cohort {
namespace {

constexpr double kPhoneGamma = 2.2;
constexpr double kUsualLight = 0.2;  // mean of a scene in good light
constexpr double kMostStops = 1.5;

// The noise after gain and gamma at the usual light.
double NoiseBehindGamma(const SensorLevel& sensor) {
  const double light = sensor.gain * kUsualLight;
  const double sigma = sensor.digital_gain * std::sqrt(sensor.shot * light + sensor.read);
  return sigma / kPhoneGamma * std::pow(sensor.digital_gain * light, 1.0 / kPhoneGamma - 1.0);
}

}  // namespace

AutoExposure::AutoExposure(double frames_per_second, unsigned seed)
    : random_(seed, "degrade/exposure"),
      frames_per_second_(frames_per_second),
      lag_(static_cast<std::size_t>(std::max(1L, std::lround(0.2 * frames_per_second)))),
      until_change_(Period()) {}

long AutoExposure::Period() {
  return std::max(1L, std::lround(frames_per_second_ * random_.Uniform(0.6, 1.4)));
}

double AutoExposure::NextStops(double light) {
  lights_.push_back(light);
  if (lights_.size() > lag_ + 1) lights_.pop_front();
  if (first_light_ == 0.0) first_light_ = light;
  if (until_change_-- > 0) return stops_;
  const int turn = 1 + static_cast<int>(random_.Below(2));
  hunting_ = (hunting_ + 1 + turn) % 3 - 1;
  const double missing = lights_.front() > 0.0 ? std::log2(first_light_ / lights_.front()) : 0.0;
  stops_ = std::clamp((std::round(3.0 * missing) + hunting_) / 3.0, -kMostStops, kMostStops);
  until_change_ = Period() - 1;
  return stops_;
}

cv::Mat PhoneDenoiser::Next(const cv::Mat& value) {
  cv::Mat out;
  cv::bilateralFilter(value, out, 5, 2.5 * sigma_, 1.5);
  if (!before_.empty()) {
    const cv::Mat difference = before_ - out;
    cv::Mat share;
    cv::GaussianBlur(difference, share, cv::Size(5, 5), 1.0);
    cv::multiply(share, share, share, -0.5 / (0.09 * sigma_ * sigma_));
    cv::exp(share, share);
    out += 0.75 * share.mul(difference);
  }
  before_ = out;
  return out.clone();
}

PhoneCamera::PhoneCamera(const DegradeOptions& options, double frames_per_second)
    : sensor_(SensorLevelAt(options.level, options.light)),
      exposure_(frames_per_second, options.seed),
      denoiser_(NoiseBehindGamma(sensor_)) {}

cv::Mat PhoneCamera::Next(const cv::Mat& light) {
  const double stops = exposure_.NextStops(cv::mean(light)[0]);
  cv::Mat value = cv::max(sensor_.digital_gain * light, 0.0);
  cv::pow(value, 1.0 / kPhoneGamma, value);
  value = denoiser_.Next(value);
  cv::Mat out;
  value.convertTo(out, CV_8U, 255.0 * std::exp2(stops / kPhoneGamma));
  return out;
}

int PhoneBitrateKbit(cv::Size size, double frames_per_second) {
  constexpr double kBitsPerPixel = 2.5e6 / (640.0 * 480.0 * 30.0);
  const double kbit = 1e-3 * kBitsPerPixel * size.area() * frames_per_second;
  return std::max(1, static_cast<int>(std::lround(kbit)));
}

}  // namespace cohort
