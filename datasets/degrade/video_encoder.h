#pragma once

#include <chrono>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <opencv2/core/types.hpp>

#include "frontend/core/options.h"

namespace cohort {

enum class VideoCodec { kH264, kHevc };
inline constexpr ChoiceNames<VideoCodec, 2> kVideoCodecNames{
    {{"h264", VideoCodec::kH264}, {"hevc", VideoCodec::kHevc}}};

// The time after which ffmpeg is considered hung; that many pictures take a small part of it.
std::chrono::seconds FfmpegLimit(std::size_t pictures);

// Encodes grey pictures into an MP4 as a phone's encoder does, with the program ffmpeg: a key frame
// every second, no look-ahead frames, fast decisions, a bit rate held within a second. It uses one
// thread and no dates, so that equal pictures give equal bytes. The pictures are stored in FILE.raw
// until the end.
//
//   VideoEncoder encoder("clip.mp4", size);
//   for (...) encoder.Add(gray);
//   encoder.Finish(VideoCodec::kH264, 2500, 30.0);
class VideoEncoder {
 public:
  // Throws Error if there is no program ffmpeg.
  VideoEncoder(std::filesystem::path file, cv::Size size);
  VideoEncoder(const VideoEncoder&) = delete;
  VideoEncoder& operator=(const VideoEncoder&) = delete;
  ~VideoEncoder();

  // CV_8UC1. An odd width or height is extended by one pixel, since codecs need even sizes.
  void Add(const cv::Mat& gray);
  // Throws Error with ffmpeg's message if it fails.
  void Finish(VideoCodec codec, int bitrate_kbit, double frames_per_second);

 private:
  std::filesystem::path ffmpeg_;
  std::filesystem::path file_;
  std::filesystem::path raw_file_;
  cv::Size size_;
  std::size_t pictures_ = 0;
  std::ofstream raw_;
};

}  // namespace cohort
