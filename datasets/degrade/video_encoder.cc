#include "datasets/degrade/video_encoder.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "frontend/core/child_process.h"
#include "frontend/core/error.h"
#include "frontend/storage/output.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

// The encoder and its own options for one thread and no look-ahead frames.
std::vector<std::string> EncoderArguments(VideoCodec codec) {
  switch (codec) {
    case VideoCodec::kH264:
      return {"-c:v", "libx264", "-preset", "veryfast", "-bf", "0"};
    case VideoCodec::kHevc:
      return {"-c:v",
              "libx265",
              "-preset",
              "veryfast",
              "-tag:v",
              "hvc1",
              "-x265-params",
              "bframes=0:pools=none:frame-threads=1:wpp=0:log-level=error"};
  }
  ThrowUsageError("unknown codec");
}

// ffmpeg's last line states why it failed.
std::string LastLine(std::string text) {
  while (!text.empty() && (text.back() == '\n' || text.back() == '\r')) text.pop_back();
  const std::size_t begin = text.find_last_of("\n\r");
  return begin == std::string::npos ? text : text.substr(begin + 1);
}

}  // namespace

std::chrono::seconds FfmpegLimit(std::size_t pictures) {
  constexpr std::chrono::minutes kStart{10};
  constexpr std::chrono::seconds kPicture{5};
  return kStart + static_cast<int>(std::min<std::size_t>(pictures, 100'000'000)) * kPicture;
}

VideoEncoder::VideoEncoder(fs::path file, cv::Size size)
    : file_(std::move(file)),
      raw_file_(file_.string() + ".raw"),
      size_(size.width + size.width % 2, size.height + size.height % 2) {
  const auto ffmpeg = FindProgram("ffmpeg");
  if (!ffmpeg) {
    ThrowError(
        "there is no program ffmpeg to encode {} with: install it (Debian: apt install ffmpeg)",
        file_.string());
  }
  ffmpeg_ = *ffmpeg;
  WriteLock::OfNewFile(raw_file_);
  raw_.open(raw_file_, std::ios::binary);
  if (!raw_) ThrowError("cannot write {}", raw_file_.string());
}

VideoEncoder::~VideoEncoder() {
  raw_.close();
  std::error_code ignored;
  fs::remove(raw_file_, ignored);
}

void VideoEncoder::Add(const cv::Mat& gray) {
  Check(gray.type() == CV_8UC1, "encoded pictures are CV_8UC1");
  cv::Mat even;
  cv::copyMakeBorder(
      gray, even, 0, size_.height - gray.rows, 0, size_.width - gray.cols, cv::BORDER_REPLICATE);
  raw_.write(reinterpret_cast<const char*>(even.data), static_cast<std::streamsize>(even.total()));
  if (!raw_) ThrowError("cannot write {}: is the disk full?", raw_file_.string());
  ++pictures_;
}

void VideoEncoder::Finish(VideoCodec codec, int bitrate_kbit, double frames_per_second) {
  raw_.close();
  if (!raw_) ThrowError("cannot write {}: is the disk full?", raw_file_.string());
  const auto key_frame_every = std::max(1L, std::lround(frames_per_second));
  std::vector<std::string> arguments{"-nostdin",
                                     "-hide_banner",
                                     "-loglevel",
                                     "error",
                                     "-y",
                                     "-f",
                                     "rawvideo",
                                     "-pixel_format",
                                     "gray",
                                     "-video_size"};
  const auto add = [&](const std::vector<std::string>& more) {
    arguments.insert(arguments.end(), more.begin(), more.end());
  };
  add({fmt::format("{}x{}", size_.width, size_.height),
       "-framerate",
       fmt::format("{:.6f}", frames_per_second)});
  // "file:", because a colon in a name would denote a protocol.
  add({"-i", "file:" + raw_file_.string(), "-an", "-sws_flags", "accurate_rnd+bitexact"});
  add({"-pix_fmt", "yuv420p", "-threads", "1", "-filter_threads", "1"});
  add(EncoderArguments(codec));
  // The bit rate on average, and up to 1.5 times as much for a moment.
  add({"-g", std::to_string(key_frame_every), "-b:v", fmt::format("{}k", bitrate_kbit)});
  add({"-maxrate", fmt::format("{}k", bitrate_kbit + bitrate_kbit / 2)});
  add({"-bufsize", fmt::format("{}k", bitrate_kbit)});
  add({"-fflags", "+bitexact", "-flags:v", "+bitexact", "-f", "mp4", "file:" + file_.string()});
  const ProgramOutput result =
      RunProgramForText(ffmpeg_, std::move(arguments), FfmpegLimit(pictures_));
  if (result.end.exit_code != 0 || result.end.signal != 0) {
    ThrowError("{} cannot encode {} as {} ({}): {}",
               ffmpeg_.string(),
               file_.string(),
               NameOf(kVideoCodecNames, codec),
               result.end.Brief(),
               LastLine(result.text));
  }
}

}  // namespace cohort
