#include "pipelines/sfm/fixed_pattern.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>

#include "frontend/image/levels.h"
#include "pipelines/sfm/fixed_parts.h"

namespace cohort {
namespace {

// What is left out of all sums at the rim: codecs and scalers leave dark lines there.
constexpr int kRimPx = 8;

// A profile without what is wider than 2 px, for the test.
cv::Mat Sharp(const cv::Mat& profile) {
  cv::Mat smooth;
  cv::blur(profile, smooth, {5, 1}, {-1, -1}, cv::BORDER_REPLICATE);
  cv::blur(smooth, smooth, {5, 1}, {-1, -1}, cv::BORDER_REPLICATE);
  return profile - smooth;
}

// A profile without what is smooth, which is the scene's rather than the sensor's.
cv::Mat Detail(const cv::Mat& profile) {
  constexpr double kSigmaPx = 4.0;
  cv::Mat smooth;
  cv::GaussianBlur(profile, smooth, {25, 1}, kSigmaPx, kSigmaPx, cv::BORDER_REPLICATE);
  return profile - smooth;
}

double MeanProduct(const cv::Mat& a, const cv::Mat& b) {
  return a.dot(b) / static_cast<double>(a.total());
}

// The energy of what both profiles have in common and no neighbour has; 0 if it is not certain.
double EnergyOfPattern(const cv::Mat& profile_a, const cv::Mat& profile_b) {
  // Clips without a pattern, rendered and real, had at most 3.5, and those with one 7.
  constexpr double kLeastOverNeighbours = 4.0;
  constexpr double kLeastSigmas = 10.0;
  const cv::Range inner(kRimPx, profile_a.cols - kRimPx);
  const cv::Mat a = Sharp(profile_a).colRange(inner);
  const cv::Mat b = Sharp(profile_b).colRange(inner);
  double neighbours = 0.0;
  for (int px = 3; px <= 8; ++px) {
    const cv::Range here(0, a.cols - px);
    const cv::Range there(px, a.cols);
    for (const auto& [of_a, of_b] : {std::pair(here, there), std::pair(there, here)}) {
      neighbours = std::max(neighbours, std::abs(MeanProduct(a.colRange(of_a), b.colRange(of_b))));
    }
  }
  const double energy = MeanProduct(a, b);
  const double sigma = std::sqrt(MeanProduct(a, a) * MeanProduct(b, b) / a.cols);
  return energy > kLeastOverNeighbours * neighbours && energy > kLeastSigmas * sigma ? energy : 0.0;
}

}  // namespace

void FixedPattern::Add(const cv::Mat& gray, bool second_half) {
  unit_ = 255.0 / WhiteLevelOf(gray);
  if (!last_.empty()) {
    change_ +=
        unit_ * unit_ * cv::norm(gray, last_, cv::NORM_L2SQR) / static_cast<double>(gray.total());
  }
  last_ = gray;
  Half& half = halves_[second_half ? 1 : 0];
  if (half.sum.empty()) half.sum = cv::Mat::zeros(gray.size(), CV_32F);
  cv::accumulate(gray, half.sum);
  ++half.frames;
}

cv::Mat FixedPattern::Find(const cv::Mat& fixed) const {
  constexpr int kLeastFrames = 12;  // of either half
  if (std::min(halves_[0].frames, halves_[1].frames) < kLeastFrames) return {};
  if (std::min(last_.cols, last_.rows) < 8 * kRimPx) return {};
  const PaintOver paint_over = fixed.empty() ? PaintOver() : PaintOver(fixed);
  std::array<cv::Mat, 2> means;
  for (std::size_t i = 0; i < means.size(); ++i) {
    means[i] = halves_[i].sum * (unit_ / halves_[i].frames);
    paint_over.Apply(means[i]);
  }
  cv::Mat pattern = cv::Mat::zeros(last_.size(), CV_32F);
  double energy = 0.0;
  for (const int along : {0, 1}) {  // columns, rows
    std::array<cv::Mat, 2> profiles;
    for (std::size_t i = 0; i < means.size(); ++i) {
      cv::reduce(means[i], profiles[i], along, cv::REDUCE_AVG);
      profiles[i] = profiles[i].reshape(1, 1);
    }
    const double found = EnergyOfPattern(profiles[0], profiles[1]);
    if (found == 0.0) continue;
    energy += found;
    const cv::Mat part = Detail(0.5 * (profiles[0] + profiles[1]));
    pattern += along == 0 ? cv::repeat(part, last_.rows, 1) : cv::repeat(part.t(), 1, last_.cols);
  }
  // Below, no error of a camera was larger for it.
  constexpr double kLeastShareOfNoise = 0.05;
  const double noise = change_ / (2.0 * (halves_[0].frames + halves_[1].frames - 1));
  if (energy <= kLeastShareOfNoise * kLeastShareOfNoise * noise) return {};
  return pattern;
}

void SubtractPattern(const cv::Mat& pattern, cv::Mat& gray) {
  cv::Mat levels;
  gray.convertTo(levels, CV_32F);
  cv::scaleAdd(pattern, -WhiteLevelOf(gray) / 255.0, levels, levels);
  levels.convertTo(gray, gray.type());
}

}  // namespace cohort
