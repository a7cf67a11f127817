#include "frontend/image/exposure.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "frontend/core/statistics.h"
#include "frontend/image/frame_offset.h"

namespace cohort {
namespace {

// A gain and an offset (of the picture's spread) nearer to none than this are none: the errors of
// the estimate itself. By eye on the tuning clips.
constexpr double kLeastChange = 0.04;

struct PixelPairs {
  std::vector<double> previous;
  std::vector<double> current;
};

// The pixels of the coarsest level that both show, black and saturated ones left out.
PixelPairs Overlap(const cv::Mat& previous, const cv::Mat& current, const Eigen::Vector2i& shift) {
  constexpr float kBlack = 0.004F;
  constexpr float kSaturated = 0.98F;
  PixelPairs pairs;
  for (int y = std::max(0, -shift.y()); y < std::min(previous.rows, current.rows - shift.y());
       ++y) {
    for (int x = std::max(0, -shift.x()); x < std::min(previous.cols, current.cols - shift.x());
         ++x) {
      const float p = previous.at<float>(y, x);
      const float c = current.at<float>(y + shift.y(), x + shift.x());
      if (std::min(p, c) <= kBlack || std::max(p, c) >= kSaturated) continue;
      pairs.previous.push_back(p);
      pairs.current.push_back(c);
    }
  }
  return pairs;
}

// Both noisy: the ratio of deviations; 0 where one has none.
LightChange Fit(const PixelPairs& pairs) {
  const auto n = static_cast<double>(pairs.previous.size());
  double mean_p = 0.0;
  double mean_c = 0.0;
  for (std::size_t i = 0; i < pairs.previous.size(); ++i) {
    mean_p += pairs.previous[i] / n;
    mean_c += pairs.current[i] / n;
  }
  double variance_p = 0.0;
  double variance_c = 0.0;
  for (std::size_t i = 0; i < pairs.previous.size(); ++i) {
    variance_p += std::pow(pairs.previous[i] - mean_p, 2) / n;
    variance_c += std::pow(pairs.current[i] - mean_c, 2) / n;
  }
  LightChange change;
  change.gain = variance_p > 0.0 ? std::sqrt(variance_c / variance_p) : 0.0;
  change.offset = mean_c - change.gain * mean_p;
  return change;
}

// Without those that fit worse than most.
PixelPairs WithoutMisfits(const PixelPairs& pairs, const LightChange& change) {
  constexpr double kKept = 0.8;
  std::vector<double> errors;
  for (std::size_t i = 0; i < pairs.previous.size(); ++i) {
    errors.push_back(std::abs(pairs.current[i] - change.gain * pairs.previous[i] - change.offset));
  }
  const double bound = Quantile(errors, kKept);
  PixelPairs kept;
  for (std::size_t i = 0; i < errors.size(); ++i) {
    if (errors[i] > bound) continue;
    kept.previous.push_back(pairs.previous[i]);
    kept.current.push_back(pairs.current[i]);
  }
  return kept;
}

// With mean 0 and deviation 1 on the coarsest level, so that registration, which looks at no other,
// sees no light.
Pyramid Standardised(const Pyramid& pyramid) {
  cv::Scalar mean;
  cv::Scalar deviation;
  cv::meanStdDev(pyramid.levels.back(), mean, deviation);
  Pyramid result = pyramid;  // the other levels are shared, not copied
  // A Mat of its own: assigned as an expression it would be written into the shared one.
  result.levels.back() = cv::Mat((pyramid.levels.back() - mean[0]) / std::max(deviation[0], 1e-6));
  return result;
}

}  // namespace

std::optional<LightChange> EstimateLightChange(const Pyramid& previous, const Pyramid& current) {
  constexpr std::size_t kEnough = 200;  // pixels
  constexpr int kRounds = 2;
  const Eigen::Vector2d d = RegisterFrames(Standardised(previous), Standardised(current));
  const double scale = std::ldexp(1.0, -static_cast<int>(current.levels.size() - 1));
  const Eigen::Vector2i shift = (scale * d).array().round().cast<int>();
  PixelPairs pairs = Overlap(previous.levels.back(), current.levels.back(), shift);
  LightChange change;
  for (int round = 0; round < kRounds; ++round) {
    if (pairs.previous.size() < kEnough) return std::nullopt;
    change = Fit(pairs);
    if (!(change.gain > 0.0)) return std::nullopt;
    pairs = WithoutMisfits(pairs, change);
  }
  return change;
}

const LightChange& Exposure::Follow(const cv::Mat& gray) {
  // Of a picture with less contrast nothing can be said, nor is it a light to bring others to.
  constexpr double kLeastDeviation = 0.05;
  Pyramid picture = BuildPyramid(gray);
  cv::Scalar mean;
  cv::Scalar deviation;
  cv::meanStdDev(picture.levels.back(), mean, deviation);
  if (deviation[0] < kLeastDeviation) return light_;
  if (previous_) {
    const auto change = EstimateLightChange(*previous_, picture);
    const bool changed = change && (std::abs(std::log(change->gain)) > kLeastChange ||
                                    std::abs(change->offset + (change->gain - 1.0) * mean[0]) >
                                        kLeastChange * deviation[0]);
    if (changed) {
      light_.offset = change->gain * light_.offset + change->offset;
      light_.gain *= change->gain;
    }
  }
  previous_ = std::move(picture);
  return light_;
}

cv::Mat WithoutLight(const cv::Mat& gray, const LightChange& light) {
  if (light.gain == 1.0 && light.offset == 0.0) return gray;
  const cv::Mat picture = BuildPyramid(gray, 1).levels.front();
  return (picture - light.offset) / light.gain;
}

}  // namespace cohort
