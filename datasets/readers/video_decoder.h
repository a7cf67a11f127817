#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <utility>

#include "frontend/core/descriptor.h"
#include "frontend/geometry/camera.h"

struct AVCodecContext;
struct AVFormatContext;
struct AVFrame;
struct AVIOContext;
struct AVPacket;
struct SwsContext;

namespace cohort {

// Decodes the first video stream of a file by FFmpeg's libraries; cover art does not count. Only
// this file is read: no protocol, and no other file that it names.
//
//   VideoDecoder video(file);
//   while (video.Next()) Use(video.Picture(), video.Seconds());
//
// Decodes on one thread, so that even a damaged file gives the same pictures every time.
class VideoDecoder {
 public:
  // The most pixels of a frame.
  static constexpr std::int64_t kMaxPixels = std::int64_t{1} << 26;

  // Throws Error naming the file if it contains no decodable video, its header states more than
  // kMaxPixels, or it is a list of other files. This and Next throw SystemError if the system does
  // not give access to the file's bytes.
  explicit VideoDecoder(const std::filesystem::path& file);
  VideoDecoder(const VideoDecoder&) = delete;
  VideoDecoder& operator=(const VideoDecoder&) = delete;
  ~VideoDecoder();

  // Decodes the next frame in display order; skips undecodable frames. Returns false at the end.
  bool Next();

  // The frame that Next has decoded, CV_8UC3 (BGR) or, with alpha that varies, CV_8UC4, rotated and mirrored by the file's display
  // matrix: a phone's portrait video is upright. Pixels that are not square are made square by the
  // width, as in players. Limited range is expanded to 0..255; the matrix is always BT.601's, so
  // that the picture's grey is the file's own luma. Throws Error if the frame's format cannot be
  // converted.
  cv::Mat Picture();

  // Width / height of the stored pixels, from the file or its codec. 1 if nearly square, not
  // stated, or implausible for a camera.
  double PixelAspect() const { return pixel_aspect_; }

  // The presentation time [s]; 0 for the first frame. It follows the file's times, which may be
  // uneven. If the file states none or one that is not later, it is 1 / fps after the frame before.
  double Seconds() const { return seconds_; }
  double FramesPerSecond() const { return frames_per_second_; }

  // The direction in Picture() of the later rows of the stored pictures, which are the sensor's.
  RowOrder SensorRows() const;

  // The text of the key, of the stream or else of the file, for the focal length [mm] of a 35 mm
  // film camera with the same view, such as Apple's
  // com.apple.quicktime.camera.focal_length.35mm_equivalent; empty if there is none.
  std::string FocalLengthIn35mmFilm() const;

  // The header's count, or its duration times its frame rate; nullopt if that is no valid count.
  std::optional<std::size_t> PromisedFrames() const;
  // Whether it is a count. A duration is that of the longest stream, even of the sound.
  bool CountsFrames() const;
  // The remaining time by the header after the frame that Next has decoded [s]; 0 without a
  // duration.
  double SecondsLeft() const;
  bool HasOtherStreams() const;  // such as sound

 private:
  struct Delete {
    void operator()(AVCodecContext* codec) const;
    void operator()(AVFormatContext* format) const;
    void operator()(AVFrame* frame) const;
    void operator()(AVIOContext* io) const;
    void operator()(AVPacket* packet) const;
    void operator()(SwsContext* converter) const;
  };
  template <typename T>
  using Owned = std::unique_ptr<T, Delete>;

  // The orientation of the stored pictures: transposed first, then mirrored.
  struct Orientation {
    bool transposed = false;
    bool mirrored_x = false;
    bool mirrored_y = false;
  };

  // FFmpeg's input.
  struct Source {
    Descriptor file;
    int error = 0;  // errno of a failed read, which FFmpeg treats as the end of the video or a gap
  };

  static int Read(void* source, std::uint8_t* bytes, int count);
  static std::int64_t Seek(void* source, std::int64_t offset, int whence);
  int ShownWidth(int stored_width_px) const;
  void CheckSource() const;
  void OpenFile();
  void OpenStream();
  void Send();  // the next packet of the stream, or its end
  void Stamp();
  void MakeConverter();
  // A frame of the shown size, and what converts decoded frames to it.
  std::pair<Owned<AVFrame>, Owned<SwsContext>> ConverterTo(int pixel_format, bool full_range) const;
  cv::Mat StoredPicture();

  std::string name_;
  Source source_;
  // Each uses those before it.
  Owned<AVIOContext> io_;
  Owned<AVFormatContext> format_;
  Owned<AVCodecContext> codec_;
  Owned<AVPacket> packet_;
  Owned<AVFrame> frame_;
  Owned<AVFrame> bgr_;
  Owned<SwsContext> converter_;
  Owned<AVFrame> bgra_;  // of a video with alpha; else unset
  Owned<SwsContext> alpha_converter_;
  int stream_ = -1;
  int width_px_ = 0;  // the converter's input
  int height_px_ = 0;
  int pixel_format_ = -1;
  bool full_range_ = false;
  Orientation orientation_;
  double pixel_aspect_ = 1.0;
  double frames_per_second_ = 0.0;
  double seconds_per_tick_ = 0.0;
  std::optional<std::int64_t> first_tick_;
  bool decoded_any_ = false;
  double seconds_ = 0.0;
};

}  // namespace cohort
