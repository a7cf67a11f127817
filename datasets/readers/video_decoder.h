#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "datasets/readers/video_filter.h"
#include "frontend/core/descriptor.h"
#include "frontend/geometry/camera.h"

struct AVCodecContext;
struct AVFormatContext;
struct AVFrame;
struct AVIOContext;
struct AVPacket;
struct SwsContext;

namespace cohort {

// Which rows of an interlaced frame were exposed first: the even ones (top) or the odd ones.
enum class FieldOrder : std::uint8_t { kTopFirst, kBottomFirst };

// Decodes the first video stream of a file by FFmpeg's libraries; cover art does not count. Only
// this file is read: no protocol, and no other file that it names.
//
//   VideoDecoder video(file);
//   while (video.Next()) Use(video.Picture(), video.Gray(), video.Seconds());
//
// Decodes on one thread, so that even a damaged file gives the same pictures every time.
class VideoDecoder {
 public:
  // The most pixels of a frame.
  static constexpr std::int64_t kMaxPixels = std::int64_t{1} << 26;

  // Throws Error naming the file if it contains no decodable video, its header states more than
  // kMaxPixels, or it is a list of other files. This and Next throw SystemError if the system does
  // not give access to the file's bytes. With a field order all frames are deinterlaced by FFmpeg's
  // filter bwdif: one frame of each, at the time of its first field.
  explicit VideoDecoder(const std::filesystem::path& file,
                        std::optional<FieldOrder> deinterlaced = std::nullopt);
  VideoDecoder(const VideoDecoder&) = delete;
  VideoDecoder& operator=(const VideoDecoder&) = delete;
  ~VideoDecoder();

  // Decodes the next frame in display order; skips undecodable frames. Returns false at the end.
  bool Next();

  // The frame that Next has decoded, CV_8UC3 (BGR), or CV_8UC4 if it has alpha that is not the same
  // everywhere, with the colours of the program ffmpeg: by the
  // matrix and range that the file states, BT.601 and limited if it states none. HDR is tone-mapped
  // to sRGB. Rotated and mirrored by the file's display matrix: a phone's portrait video is
  // upright. Pixels that are not square are made square by the width, as in players. Throws Error
  // if the frame's format cannot be converted.
  cv::Mat Picture();
  // Its grey, CV_8UC1: the file's own luma, expanded to 0..255, since colours are stored with less
  // detail; that of the tone-mapped picture for HDR.
  cv::Mat Gray();

  // "HLG" or "PQ" if the frame that Next has decoded is HDR, else empty.
  std::string_view Hdr() const;
  // That of the frame that Next has decoded, by its own flags or else the file's, if it is flagged
  // as interlaced.
  std::optional<FieldOrder> FlaggedFieldOrder() const;
  const AVFrame& DecodedFrame() const { return *frame_; }

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

  // From frames of one kind to BGR of 8 bits with square pixels.
  struct Converter {
    Owned<SwsContext> context;
    Owned<AVFrame> bgr;
    bool with_alpha = false;  // bgr is BGRA
    bool current = false;     // bgr is the frame that Next has decoded
    int width_px = 0;         // the input
    int height_px = 0;
    int pixel_format = -1;
    bool full_range = false;
    int matrix = -1;
  };

  static int Read(void* source, std::uint8_t* bytes, int count);
  static std::int64_t Seek(void* source, std::int64_t offset, int whence);
  int ShownWidth(int stored_width_px) const;
  void CheckSource() const;
  void OpenFile();
  void OpenStream();
  void Send();  // the next packet of the stream, or its end
  bool Decode();
  bool Deinterlace();
  void Stamp();
  const AVFrame& Shown();  // tone-mapped if it is HDR
  void MakeConverter(const AVFrame& frame, int matrix, Converter& converter) const;
  // The frame in BGR by this matrix, as it is stored. Valid until the next frame.
  cv::Mat Convert(const AVFrame& frame, int matrix, Converter& converter) const;
  cv::Mat Upright(const cv::Mat& stored) const;
  // The frame's alpha, as it is stored; empty if it has none, or one alpha everywhere.
  cv::Mat Alpha(const AVFrame& frame);

  std::string name_;
  Source source_;
  // Each uses those before it.
  Owned<AVIOContext> io_;
  Owned<AVFormatContext> format_;
  Owned<AVCodecContext> codec_;
  Owned<AVPacket> packet_;
  Owned<AVFrame> frame_;
  Owned<AVFrame> tone_mapped_;
  bool tone_mapped_current_ = false;
  std::optional<VideoFilter> tone_mapper_;
  std::optional<VideoFilter> deinterlacer_;
  std::optional<FieldOrder> deinterlaced_;
  Converter color_;
  Converter luma_;
  Converter alpha_;
  int stream_ = -1;
  Orientation orientation_;
  double pixel_aspect_ = 1.0;
  double frames_per_second_ = 0.0;
  double seconds_per_tick_ = 0.0;
  std::optional<std::int64_t> first_tick_;
  bool decoded_any_ = false;
  double seconds_ = 0.0;
};

}  // namespace cohort
