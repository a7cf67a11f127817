#include "pipelines/report/track_picture.h"

#include <algorithm>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <vector>

#include "frontend/core/error.h"
#include "frontend/image/write_image.h"

namespace cohort {
namespace {

constexpr std::ptrdiff_t kTailFrames = 8;
constexpr double kNearPx = 1.0;
constexpr double kFarPx = 3.0;
// Blue, green, red; also distinguishable for colour-blind readers.
const cv::Scalar kUnknownColor(230, 200, 80);
const cv::Scalar kPredictedColor(60, 160, 255);
const cv::Scalar kNearColor(150, 200, 20);
const cv::Scalar kMiddleColor(40, 190, 240);
const cv::Scalar kFarColor(60, 60, 235);
const cv::Scalar kTruthColor(255, 255, 255);
constexpr int kShift = 4;  // fractional bits of drawing coordinates

cv::Point FixedPoint(const Eigen::Vector2d& xy) {
  constexpr double kOne = 1 << kShift;
  return {static_cast<int>(std::lround(kOne * xy.x())),
          static_cast<int>(std::lround(kOne * xy.y()))};
}

std::optional<Eigen::Vector2d> TruePositionOf(std::span<const Observation> track,
                                              FrameIndex frame,
                                              TrackTruth* truth) {
  if (truth == nullptr) return std::nullopt;
  // As in EvaluateTracks, the anchor is the first observed position, because a predicted one makes
  // no claim.
  const auto first = std::ranges::find(track, ObservationState::kObserved, &Observation::state);
  if (first == track.end()) return std::nullopt;
  const auto anchor = truth->Pick(first->frame, first->xy);
  if (!anchor) return std::nullopt;
  const auto position = truth->Locate(*anchor, frame);
  if (!position) return std::nullopt;
  return position->xy;
}

}  // namespace

TrackPicture DrawTracks(const cv::Mat& picture,
                        FrameIndex frame,
                        const TrackSet& tracks,
                        TrackTruth* truth) {
  TrackPicture result;
  result.picture = picture.clone();
  // Counts the tracks' own frames, which may be every n-th of the clip.
  const auto& frames = tracks.frames();
  const auto here = std::ranges::lower_bound(frames, frame);
  const auto tail = std::min<std::ptrdiff_t>(kTailFrames, here - frames.begin());
  for (const Observation* o : tracks.InFrame(frame)) {
    const auto track = tracks.Track(o->feature);
    const auto true_xy = TruePositionOf(track, frame, truth);
    const bool is_observed = o->state == ObservationState::kObserved;
    ++(is_observed ? result.observed : result.predicted);
    cv::Scalar color = is_observed ? kUnknownColor : kPredictedColor;
    if (true_xy) {
      const double error_px = (o->xy - *true_xy).norm();
      color = error_px <= kNearPx ? kNearColor : error_px <= kFarPx ? kMiddleColor : kFarColor;
      if (is_observed) ++result.known;
      if (is_observed && error_px <= kNearPx) ++result.near_truth;
      if (is_observed && error_px > kFarPx) ++result.far;
    }
    auto other = std::ranges::lower_bound(track, *(here - tail), {}, &Observation::frame);
    for (; other != track.end() && other->frame <= frame; ++other) {
      if (other == track.begin()) continue;
      cv::line(result.picture,
               FixedPoint(std::prev(other)->xy),
               FixedPoint(other->xy),
               color,
               1,
               cv::LINE_AA,
               kShift);
    }
    const int radius = 3 << kShift;
    cv::circle(result.picture,
               FixedPoint(o->xy),
               radius,
               color,
               is_observed ? cv::FILLED : 1,
               cv::LINE_AA,
               kShift);
    if (true_xy) {
      for (const Eigen::Vector2d& arm : {Eigen::Vector2d(2.5, 0.0), Eigen::Vector2d(0.0, 2.5)}) {
        cv::line(result.picture,
                 FixedPoint(*true_xy - arm),
                 FixedPoint(*true_xy + arm),
                 kTruthColor,
                 1,
                 cv::LINE_AA,
                 kShift);
      }
    }
  }
  return result;
}

std::string JpegDataUri(const cv::Mat& picture, int quality) {
  const auto encoded = EncodedImage(".jpg", picture, {cv::IMWRITE_JPEG_QUALITY, quality});
  if (!encoded) {  // sides of more than 65,500
    ThrowError("OpenCV makes no JPEG of a picture of {}x{}", picture.cols, picture.rows);
  }
  const std::vector<unsigned char>& jpeg = *encoded;
  constexpr const char* kDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string uri = "data:image/jpeg;base64,";
  for (std::size_t i = 0; i < jpeg.size(); i += 3) {
    std::uint32_t bits = 0;
    for (std::size_t k = 0; k < 3; ++k) bits = bits << 8 | (i + k < jpeg.size() ? jpeg[i + k] : 0U);
    for (std::size_t k = 0; k < 4; ++k) {
      uri += i + k <= jpeg.size() ? kDigits[bits >> (18 - 6 * k) & 63U] : '=';
    }
  }
  return uri;
}

}  // namespace cohort
