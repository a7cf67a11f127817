#include "pipelines/sfm/fixed_pattern.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "frontend/image/levels.h"

namespace cohort {
namespace {

// What is left out of all sums at the rim: codecs and scalers leave dark lines there.
constexpr int kRimPx = 8;

cv::Size Along(const cv::Mat& values, int px) {
  return {values.cols > 1 ? px : 1, values.rows > 1 ? px : 1};
}

// Without what is wider than 2 px, along either side of the picture, for the test.
cv::Mat Sharp(const cv::Mat& values) {
  constexpr int kBoxPx = 5;
  cv::Mat sharp = values.clone();
  for (const cv::Size& box : {cv::Size(kBoxPx, 1), cv::Size(1, kBoxPx)}) {
    if ((box.width > 1 ? values.cols : values.rows) == 1) continue;
    cv::Mat smooth;
    cv::blur(sharp, smooth, box, {-1, -1}, cv::BORDER_REPLICATE);
    cv::blur(smooth, smooth, box, {-1, -1}, cv::BORDER_REPLICATE);
    sharp -= smooth;
  }
  return sharp;
}

// Without what is smooth, which is the scene's rather than the sensor's.
cv::Mat Detail(const cv::Mat& values) {
  constexpr double kSigmaPx = 4.0;
  constexpr int kReachPx = 25;
  cv::Mat smooth;
  cv::GaussianBlur(
      values, smooth, Along(values, kReachPx), kSigmaPx, kSigmaPx, cv::BORDER_REPLICATE);
  return values - smooth;
}

cv::Mat Inner(const cv::Mat& values) {
  const cv::Size rim = Along(values, 1 + kRimPx) - cv::Size(1, 1);
  return values(cv::Rect(cv::Point(rim), values.size() - rim - rim));
}

double MeanProduct(const cv::Mat& a, const cv::Mat& b) {
  return a.dot(b) / static_cast<double>(a.total());
}

// The energy of what both have in common and no neighbour has; 0 if it is not certain.
double EnergyOfPattern(const cv::Mat& half_a, const cv::Mat& half_b) {
  // Rendered and real clips without a pattern have at most 3.5, those with one 7.
  constexpr double kLeastOverNeighbours = 4.0;
  constexpr double kLeastSigmas = 10.0;
  const cv::Mat a = Inner(Sharp(half_a));
  const cv::Mat b = Inner(Sharp(half_b));
  double neighbours = 0.0;
  for (int px = 3; px <= 8; ++px) {
    for (const cv::Size& d : {cv::Size(px, 0), cv::Size(0, px)}) {
      if (a.cols <= 2 * d.width || a.rows <= 2 * d.height) continue;
      const cv::Rect here(cv::Point(), a.size() - d);
      const cv::Rect there(cv::Point(d), a.size() - d);
      neighbours = std::max({neighbours,
                             std::abs(MeanProduct(a(here), b(there))),
                             std::abs(MeanProduct(a(there), b(here)))});
    }
  }
  const double energy = MeanProduct(a, b);
  const double sigma =
      std::sqrt(MeanProduct(a, a) * MeanProduct(b, b) / static_cast<double>(a.total()));
  return energy > kLeastOverNeighbours * neighbours && energy > kLeastSigmas * sigma ? energy : 0.0;
}

// The mean of both, of which noise is left out: m (1 - v / m^2) with the variance v of its noise.
cv::Mat Estimate(const cv::Mat& half_a, const cv::Mat& half_b) {
  const cv::Mat mean = Detail(0.5 * (half_a + half_b));
  const cv::Mat apart = Inner(Detail(half_a - half_b));
  const auto v = static_cast<float>(MeanProduct(apart, apart) / 4.0);
  cv::Mat estimate = mean.clone();
  estimate.forEach<float>([v](float& m, const int*) { m = m * m > v ? m - v / m : 0.0F; });
  return estimate;
}

}  // namespace

void FixedPattern::Add(const cv::Mat& gray, bool second_half) {
  const cv::Mat levels = LevelsOf(gray);
  if (!last_.empty()) {
    change_ += cv::norm(levels, last_, cv::NORM_L2SQR) / static_cast<double>(levels.total());
  }
  last_ = levels;
  Half& half = halves_[second_half ? 1 : 0];
  if (half.sum.empty()) half.sum = cv::Mat::zeros(levels.size(), CV_32F);
  half.sum += levels;
  ++half.frames;
}

cv::Mat FixedPattern::Find(const cv::Mat& fixed) const {
  constexpr int kLeastFrames = 12;  // of either half
  if (std::min(halves_[0].frames, halves_[1].frames) < kLeastFrames) return {};
  if (std::min(last_.cols, last_.rows) < 8 * kRimPx) return {};
  std::array<cv::Mat, 2> rest;
  for (int i = 0; i < 2; ++i) {
    rest[i] = halves_[i].sum / halves_[i].frames;
    if (!fixed.empty()) {
      cv::Mat smooth;
      cv::blur(rest[i], smooth, {31, 31});
      smooth.copyTo(rest[i], fixed);
    }
  }
  cv::Mat pattern = cv::Mat::zeros(last_.size(), CV_32F);
  double energy = 0.0;
  for (const int along : {0, 1, -1}) {  // columns, rows, pixels
    std::array<cv::Mat, 2> halves = rest;
    if (along >= 0) {
      for (cv::Mat& half : halves) cv::reduce(half, half, along, cv::REDUCE_AVG);
    }
    const double found = EnergyOfPattern(halves[0], halves[1]);
    if (found == 0.0) continue;
    energy += found;
    cv::Mat part = Estimate(halves[0], halves[1]);
    if (along >= 0) part = cv::repeat(part, last_.rows / part.rows, last_.cols / part.cols);
    pattern += part;
    for (cv::Mat& half : rest) half -= part;
  }
  // Below, no error of a camera was larger for it.
  constexpr double kLeastShareOfNoise = 0.05;
  const double noise = change_ / (2.0 * (halves_[0].frames + halves_[1].frames - 1));
  if (energy <= kLeastShareOfNoise * kLeastShareOfNoise * noise) return {};
  if (!fixed.empty()) pattern.setTo(0.0F, fixed);
  return pattern;
}

void SubtractPattern(const cv::Mat& pattern, cv::Mat& gray) {
  cv::Mat levels;
  gray.convertTo(levels, CV_32F);
  cv::scaleAdd(pattern, -WhiteLevelOf(gray) / 255.0, levels, levels);
  levels.convertTo(gray, gray.type());
}

}  // namespace cohort
