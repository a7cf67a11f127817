#include "frontend/image/exposure.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "frontend/core/part_times.h"
#include "frontend/core/statistics.h"
#include "frontend/image/frame_offset.h"

namespace cohort {
namespace {

// A smaller change of gain and offset (relative to the picture's spread) counts as none. It covers
// the errors of the estimate itself, which grow if the contrast is only a few steps of the
// intensities. Tuned on the tuning clips.
double LeastChange(double deviation_in_steps) {
  constexpr double kLeast = 0.04;
  constexpr double kManySteps = 12.75;  // 0.05 of 8 bits
  return kLeast * std::max(1.0, kManySteps / deviation_in_steps);
}

struct PixelPairs {
  std::vector<double> previous;
  std::vector<double> current;
};

// The pixels of the coarsest level that both pictures show, without black (up to `black`) and
// saturated ones.
PixelPairs Overlap(const cv::Mat& previous,
                   const cv::Mat& current,
                   const Eigen::Vector2i& shift,
                   float black) {
  constexpr float kSaturated = 0.98F;
  PixelPairs pairs;
  for (int y = std::max(0, -shift.y()); y < std::min(previous.rows, current.rows - shift.y());
       ++y) {
    for (int x = std::max(0, -shift.x()); x < std::min(previous.cols, current.cols - shift.x());
         ++x) {
      const float p = previous.at<float>(y, x);
      const float c = current.at<float>(y + shift.y(), x + shift.x());
      if (std::min(p, c) <= black || std::max(p, c) >= kSaturated) continue;
      pairs.previous.push_back(p);
      pairs.current.push_back(c);
    }
  }
  return pairs;
}

struct LightFit {
  LightChange change;
  double correlation = 0.0;  // of the pairs to which it was fitted
};
// Both are noisy, so the gain is the ratio of the standard deviations; the correlation is 0 if one
// of them is 0.
LightFit Fit(const PixelPairs& pairs) {
  const auto n = static_cast<double>(pairs.previous.size());
  double mean_p = 0.0;
  double mean_c = 0.0;
  for (std::size_t i = 0; i < pairs.previous.size(); ++i) {
    mean_p += pairs.previous[i] / n;
    mean_c += pairs.current[i] / n;
  }
  double variance_p = 0.0;
  double variance_c = 0.0;
  double covariance = 0.0;
  for (std::size_t i = 0; i < pairs.previous.size(); ++i) {
    const double p = pairs.previous[i] - mean_p;
    const double c = pairs.current[i] - mean_c;
    variance_p += p * p / n;
    variance_c += c * c / n;
    covariance += p * c / n;
  }
  LightFit fit;
  if (!(variance_p > 0.0 && variance_c > 0.0)) return fit;
  fit.change.gain = std::sqrt(variance_c / variance_p);
  fit.change.offset = mean_c - fit.change.gain * mean_p;
  fit.correlation = covariance / std::sqrt(variance_p * variance_c);
  return fit;
}

// The pairs without those that fit worse than most.
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

// With mean 0 and standard deviation 1 on the coarsest level, the only one that registration uses,
// so that light does not affect it.
Pyramid Standardised(const Pyramid& pyramid) {
  cv::Scalar mean;
  cv::Scalar deviation;
  cv::meanStdDev(pyramid.levels.back(), mean, deviation);
  Pyramid result = pyramid;  // the other levels are shared, not copied
  // A separate Mat: assigning the expression would write into the shared one.
  result.levels.back() = cv::Mat((pyramid.levels.back() - mean[0]) / std::max(deviation[0], 1e-6));
  return result;
}

}  // namespace

std::optional<LightChange> EstimateLightChange(const Pyramid& previous, const Pyramid& current) {
  constexpr std::size_t kEnough = 200;  // pixels
  constexpr int kRounds = 2;
  constexpr double kAlike = 0.95;  // correlation; tuned on the tuning clips
  constexpr double kBlack = 1.02;  // steps of the intensities
  const Eigen::Vector2d d = RegisterFrames(Standardised(previous), Standardised(current));
  const double scale = std::ldexp(1.0, -static_cast<int>(current.levels.size() - 1));
  const Eigen::Vector2i shift = (scale * d).array().round().cast<int>();
  PixelPairs pairs = Overlap(previous.levels.back(),
                             current.levels.back(),
                             shift,
                             static_cast<float>(kBlack * std::max(previous.step, current.step)));
  LightFit fit;
  for (int round = 0; round < kRounds; ++round) {
    if (pairs.previous.size() < kEnough) return std::nullopt;
    fit = Fit(pairs);
    if (!(fit.correlation > 0.0)) return std::nullopt;
    if (round + 1 < kRounds) pairs = WithoutMisfits(pairs, fit.change);
  }
  if (fit.correlation < kAlike) return std::nullopt;
  return fit.change;
}

const LightChange& Exposure::Follow(const cv::Mat& gray) { return Follow(BuildPyramid(gray)); }

const LightChange& Exposure::Follow(const Pyramid& picture) {
  const TimedPart part("light");
  // Minimum contrast in steps of the intensities. Below it the light cannot be estimated, and the
  // picture is not suitable as a reference.
  constexpr double kLeastDeviation = 2.5;
  cv::Scalar mean;
  cv::Scalar deviation;
  cv::meanStdDev(picture.levels.back(), mean, deviation);
  if (deviation[0] < kLeastDeviation * picture.step) return light_;
  const std::optional<LightChange> light = LightOf(picture);
  if (light) {
    // The change of the picture relative to the light of the last one.
    const double gain = light->gain / light_.gain;
    const double offset = light->offset - gain * light_.offset;
    const double least = LeastChange(deviation[0] / picture.step);
    if (std::abs(std::log(gain)) > least ||
        std::abs(offset + (gain - 1.0) * mean[0]) > least * deviation[0]) {
      light_ = *light;
    }
  }
  last_ = {picture, light_};
  if (!reference_) reference_ = last_;
  return light_;
}

// The light relative to the reference. If the reference is too different, the last picture becomes
// the reference.
std::optional<LightChange> Exposure::LightOf(const Pyramid& picture) {
  const auto against = [&](const Seen& seen) {
    std::optional<LightChange> light = EstimateLightChange(seen.picture, picture);
    if (light) {
      light->offset += light->gain * seen.light.offset;
      light->gain *= seen.light.gain;
    }
    return light;
  };
  if (!reference_) return std::nullopt;
  if (auto light = against(*reference_)) return light;
  reference_ = last_;
  if (auto light = against(*reference_)) return light;
  reference_.reset();  // this picture cannot be related to earlier ones
  return std::nullopt;
}

cv::Mat WithoutLight(const cv::Mat& gray, const LightChange& light) {
  const TimedPart part("light");
  if (light.IsNone()) return gray;
  const cv::Mat picture = BuildPyramid(gray, 1).levels.front();
  return (picture - light.offset) / light.gain;
}

Frame WithoutLight(Frame frame, const LightChange& light) {
  frame.float_step = IntensityStep(frame.gray) / light.gain;
  frame.gray = WithoutLight(frame.gray, light);
  return frame;
}

}  // namespace cohort
