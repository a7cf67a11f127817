#include "pipelines/sfm/fixed_parts.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "frontend/core/statistics.h"
#include "frontend/image/levels.h"
#include "pipelines/sfm/fixed_pattern.h"

namespace cohort {
namespace {

constexpr double kFineSigmaPx = 1.0;
// The coarse gradients are those of pictures of a quarter of the size: 3 px there.
constexpr int kCoarse = 4;
constexpr double kCoarseSigmaPx = 0.75;
// With 9 pairs of a small clip, a few edges along the motion agreed by chance.
constexpr std::size_t kLeastPairs = 12;

// How many times smaller the pictures are made: text and bars of large pictures are larger, too.
int Reduction(const cv::Size& size) {
  constexpr int kMostPx = 600;  // of the shorter side
  return std::max(1, (std::min(size.width, size.height) + kMostPx - 1) / kMostPx);
}

cv::Mat Reduced(const cv::Mat& picture, int by) {
  if (by == 1) return picture;
  cv::Mat reduced;
  const cv::Size size(std::max(1, picture.cols / by), std::max(1, picture.rows / by));
  cv::resize(picture, reduced, size, 0.0, 0.0, cv::INTER_AREA);
  return reduced;
}

cv::Mat BoxMean(const cv::Mat& values) {
  constexpr int kSidePx = 5;
  cv::Mat mean;
  cv::blur(values, mean, cv::Size(kSidePx, kSidePx));
  return mean;
}

cv::Mat Grown(const cv::Mat& mask, int by_px) {
  cv::Mat grown;
  const cv::Size size(2 * by_px + 1, 2 * by_px + 1);
  cv::dilate(mask, grown, cv::getStructuringElement(cv::MORPH_ELLIPSE, size));
  return grown;
}

double MedianWhere(const cv::Mat& values, const cv::Mat& where) {
  std::vector<double> sample;
  for (int y = 0; y < values.rows; ++y) {
    for (int x = 0; x < values.cols; ++x) {
      if (where.at<std::uint8_t>(y, x) != 0) sample.push_back(values.at<float>(y, x));
    }
  }
  return Median(std::move(sample));
}

void RemoveSpecks(cv::Mat& mask) {
  constexpr int kLeastPx = 40;
  cv::Mat labels;
  cv::Mat stats;
  cv::Mat centroids;
  const int count = cv::connectedComponentsWithStats(mask, labels, stats, centroids);
  std::vector<std::uint8_t> kept(static_cast<std::size_t>(count), 0);
  for (int i = 1; i < count; ++i) {
    if (stats.at<int>(i, cv::CC_STAT_AREA) >= kLeastPx) kept[i] = 255;
  }
  mask.forEach<std::uint8_t>([&](std::uint8_t& pixel, const int* at) {
    pixel = kept[static_cast<std::size_t>(labels.at<int>(at[0], at[1]))];
  });
}

}  // namespace

FixedParts::Gradients FixedParts::Of(const cv::Mat& levels, double sigma_px) {
  cv::Mat blurred;
  cv::GaussianBlur(levels, blurred, cv::Size(0, 0), sigma_px);
  Gradients g;
  cv::Sobel(blurred, g.x, CV_32F, 1, 0, 1, 0.5);
  cv::Sobel(blurred, g.y, CV_32F, 0, 1, 1, 0.5);
  return g;
}

// Of unit length unless they are faint, so that all areas with texture count alike.
FixedParts::Gradients FixedParts::Directions(const Gradients& g) {
  constexpr double kFaintLevels = 0.2;
  cv::Mat length;
  cv::magnitude(g.x, g.y, length);
  length += kFaintLevels;
  return {g.x / length, g.y / length};
}

void FixedParts::Sums::Add(const Gradients& g, const Gradients& next) {
  if (near.empty()) {
    for (cv::Mat* of_pairs : {&sum.x, &sum.y, &near, &energy}) {
      *of_pairs = cv::Mat::zeros(g.x.size(), CV_32F);
    }
  }
  for (cv::Mat Gradients::*of : {&Gradients::x, &Gradients::y}) {
    cv::accumulate(g.*of, sum.*of);
    cv::accumulate(next.*of, sum.*of);
    cv::accumulateProduct(g.*of, next.*of, near);
    cv::accumulateSquare(g.*of, energy);
    cv::accumulateSquare(next.*of, energy);
  }
}

// The sum over k != l is the square of the sum over all k without the squares.
cv::Mat FixedParts::Sums::Far(std::size_t pairs) const {
  const auto n = static_cast<double>(pairs);
  const cv::Mat all = sum.x.mul(sum.x) + sum.y.mul(sum.y);
  return (all - energy - 2.0 * near) / (4.0 * n * (n - 1.0));
}

cv::Mat FixedParts::Sums::Near(std::size_t pairs) const {
  return near / static_cast<double>(pairs);
}

cv::Mat FixedParts::Sums::Energy(std::size_t pairs) const {
  return energy / (2.0 * static_cast<double>(pairs));
}

void FixedParts::Add(const cv::Mat& gray, const cv::Mat& next) {
  size_ = gray.size();
  const int by = Reduction(size_);
  const cv::Mat levels[] = {LevelsOf(Reduced(gray, by)), LevelsOf(Reduced(next, by))};
  const Gradients coarse[] = {Of(Reduced(levels[0], kCoarse), kCoarseSigmaPx),
                              Of(Reduced(levels[1], kCoarse), kCoarseSigmaPx)};
  // Two pairs show the same if they agree as one does within itself, and that is nearly entirely.
  constexpr double kSame = 0.9;
  const Gradients directions = Directions(coarse[0]);
  if (!last_.x.empty()) {
    const double within = directions.Dot(Directions(coarse[1]));
    if (within > kSame * directions.Dot(directions) && directions.Dot(last_) > kSame * within) {
      return;
    }
  }
  last_ = directions;
  ++pairs_;
  coarse_.Add(coarse[0], coarse[1]);
  fine_.Add(Of(levels[0], kFineSigmaPx), Of(levels[1], kFineSigmaPx));
  if (least_.empty()) {
    least_ = levels[0].clone();
    most_ = levels[0].clone();
  }
  for (const cv::Mat& picture : levels) {
    cv::min(least_, picture, least_);
    cv::max(most_, picture, most_);
  }
}

cv::Mat FixedParts::Standing() const {
  const cv::Mat far = BoxMean(fine_.Far(pairs_));
  const cv::Mat near = BoxMean(fine_.Near(pairs_));
  // What noise leaves of its energy in a mean over n pairs is of the order of 1/n.
  const cv::Mat noise = BoxMean(fine_.Energy(pairs_)) * (4.0 / static_cast<double>(pairs_));
  // No features are found on what is fainter than half of the texture.
  const double faint = MedianWhere(near, near > noise);
  cv::Mat standing = (far > 0.8 * near) & (far > noise) & (far > faint);
  RemoveSpecks(standing);
  return standing;
}

// Areas that never change and whose outline is fixed. A dark sky does not change either, but its
// outline moves.
cv::Mat FixedParts::Dead() const {
  constexpr double kMostLevels = 2.0;
  constexpr int kOutlinePx = 4;
  cv::Mat dead = (most_ - least_) <= kMostLevels;
  cv::morphologyEx(dead, dead, cv::MORPH_OPEN, cv::Mat::ones(5, 5, CV_8U));
  const cv::Mat far = fine_.Far(pairs_);
  const cv::Mat near = fine_.Near(pairs_);
  cv::Mat fixed = cv::Mat::zeros(dead.size(), CV_8U);
  cv::Mat labels;
  const int count = cv::connectedComponents(dead, labels);
  for (int i = 1; i < count; ++i) {
    const cv::Mat area = labels == i;
    const cv::Mat outline = Grown(area, kOutlinePx) & ~area;
    // The brightness of the scene beside a bar varies, and the gradient with it: hence less than
    // for what stands.
    if (cv::mean(far, outline)[0] > std::max(0.5 * cv::mean(near, outline)[0], 0.0)) {
      fixed |= area | outline;
    }
  }
  return fixed;
}

bool FixedParts::RestMoves(const cv::Mat& fixed) const {
  if (pairs_ < kLeastPairs) return false;
  cv::Mat rest(coarse_.near.size(), CV_8U, cv::Scalar(255));
  if (!fixed.empty()) {
    cv::resize(fixed, rest, rest.size(), 0.0, 0.0, cv::INTER_AREA);
    rest = rest == 0;
  }
  const double far = cv::mean(coarse_.Far(pairs_), rest)[0];
  const double near = cv::mean(coarse_.Near(pairs_), rest)[0];
  // Where it moves fast or is very dark, two successive pictures do not agree either.
  const double energy = cv::mean(coarse_.Energy(pairs_), rest)[0];
  return far < 0.6 * near || near < 0.1 * energy;
}

cv::Mat FixedParts::Find() const {
  if (pairs_ < kLeastPairs) return {};
  cv::Mat fixed = Standing() | Dead();
  if (cv::countNonZero(fixed) == 0 || !RestMoves(fixed)) return {};
  constexpr int kHaloPx = 3;  // of compression and of the blur
  cv::resize(Grown(fixed, kHaloPx), fixed, size_, 0.0, 0.0, cv::INTER_NEAREST);
  return fixed;
}

WhatStays FindWhatStays(Sequence& sequence) {
  constexpr std::size_t kPairs = 24;
  constexpr std::size_t kMostFrames = 1000;
  // Up to 10 frames apart, so that slow scenes move in between.
  const std::size_t count = sequence.FrameCount().value_or(kMostFrames);
  const std::size_t stride = std::clamp<std::size_t>(count / kPairs, 2, 10);
  const std::size_t half = std::min(count / stride, kPairs) / 2;
  FixedParts parts;
  FixedPattern pattern;
  cv::Mat first;
  for (std::size_t i = 0; i < kMostFrames && parts.pairs() < kPairs; ++i) {
    const auto frame = sequence.Next();
    if (!frame) break;
    pattern.Add(frame->gray, parts.pairs() >= half);
    if (i % stride == 0) first = frame->gray;
    if (i % stride == 1) parts.Add(first, frame->gray);
  }
  sequence.Rewind();
  WhatStays stays;
  stays.parts = parts.Find();
  if (parts.RestMoves(stays.parts)) stays.pattern = pattern.Find(stays.parts);
  return stays;
}

cv::Mat MaskOfFixedParts(const cv::Mat& fixed) {
  constexpr int kReachPx = 10;  // of the windows of 21 px in which features are tracked
  return Grown(fixed, kReachPx) == 0;
}

PaintOver::PaintOver(const cv::Mat& fixed) {
  cv::Mat distance;
  cv::Mat labels;  // the same for a pixel and the nearest one that is not fixed
  cv::distanceTransform(
      fixed, distance, labels, cv::DIST_L2, cv::DIST_MASK_5, cv::DIST_LABEL_PIXEL);
  std::vector<cv::Point> by_label(1);
  for (int y = 0; y < fixed.rows; ++y) {
    for (int x = 0; x < fixed.cols; ++x) {
      if (fixed.at<std::uint8_t>(y, x) != 0) continue;
      const auto label = static_cast<std::size_t>(labels.at<int>(y, x));
      if (label >= by_label.size()) by_label.resize(label + 1);
      by_label[label] = {x, y};
    }
  }
  for (int y = 0; y < fixed.rows; ++y) {
    for (int x = 0; x < fixed.cols; ++x) {
      if (fixed.at<std::uint8_t>(y, x) == 0) continue;
      copies_.push_back({by_label[static_cast<std::size_t>(labels.at<int>(y, x))], {x, y}});
    }
  }
}

void PaintOver::Apply(cv::Mat& gray) const {
  const std::size_t bytes = gray.elemSize();
  for (const auto& [from, to] : copies_) {
    std::memcpy(gray.ptr(to.y, to.x), gray.ptr(from.y, from.x), bytes);
  }
}

}  // namespace cohort
