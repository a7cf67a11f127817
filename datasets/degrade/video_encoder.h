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

// After which ffmpeg, which takes a small part of it for so many pictures, hangs.
std::chrono::seconds FfmpegLimit(std::size_t pictures);

// Encodes grey pictures into an MP4 as a phone's encoder does, with the program ffmpeg: a key frame
// every second, no frames that look ahead, quick decisions, a bit rate that is held within a
// second. One thread and no dates: the same pictures give the same bytes. The pictures wait in
// FILE.raw until the end.
//
//   VideoEncoder encoder("clip.mp4", size);
//   for (...) encoder.Add(gray);
//   encoder.Finish(VideoCodec::kH264, 2500, 30.0);
class VideoEncoder {
 public:
  // Throws Error where there is no program ffmpeg.
  VideoEncoder(std::filesystem::path file, cv::Size size);
  VideoEncoder(const VideoEncoder&) = delete;
  VideoEncoder& operator=(const VideoEncoder&) = delete;
  ~VideoEncoder();

  // CV_8UC1. An odd width or height is continued by a pixel, which codecs want even.
  void Add(const cv::Mat& gray);
  // Throws Error with what ffmpeg says if it cannot.
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
