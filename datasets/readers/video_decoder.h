#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

#include "frontend/core/descriptor.h"
#include "frontend/geometry/camera.h"

struct AVCodecContext;
struct AVFormatContext;
struct AVFrame;
struct AVIOContext;
struct AVPacket;
struct SwsContext;

namespace cohort {

// What FFmpeg's libraries make of the first video stream of a file; cover art is none. The file is
// all that is read: no protocol, and no other file that it names.
//
//   VideoDecoder video(file);
//   while (video.Next()) Use(video.Picture(), video.Seconds());
//
// Decodes on one thread, so that a damaged file, too, gives the same pictures every time.
class VideoDecoder {
 public:
  // The most pixels of a frame.
  static constexpr std::int64_t kMaxPixels = std::int64_t{1} << 26;

  // Throws Error naming the file if there is no video in it that can be decoded, its header has
  // more than kMaxPixels, or it is a list of other files; SystemError, also of Next, where the
  // system does not give the file's bytes.
  explicit VideoDecoder(const std::filesystem::path& file);
  VideoDecoder(const VideoDecoder&) = delete;
  VideoDecoder& operator=(const VideoDecoder&) = delete;
  ~VideoDecoder();

  // Decodes a frame, in the order of display; frames that cannot be decoded are left out. False at
  // the end.
  bool Next();

  // The frame that Next has decoded, CV_8UC3 (BGR), turned and mirrored as the file's display
  // matrix says: a phone's portrait video stands upright. Pixels that are not square are made so by
  // the width, as players do. Limited range is spread to 0..255; the matrix is always BT.601's, so
  // that grey of the picture is the file's own luma. Throws Error if the frame is of a kind that
  // cannot be converted.
  cv::Mat Picture();

  // Width / height of the pixels that the file stores, as it or its codec says; 1 of nearly square
  // ones, and where it says nothing or what is no pixel of a camera.
  double PixelAspect() const { return pixel_aspect_; }

  // When it is shown [s]; the first frame at 0. By the file's times, which need not be even; 1 /
  // fps after the frame before it where the file gives none or one that is not later.
  double Seconds() const { return seconds_; }
  double FramesPerSecond() const { return frames_per_second_; }

  // Where Picture() has the later rows of the pictures that the file stores, which are the
  // sensor's.
  RowOrder SensorRows() const;

  // The text of the key, of the stream or else of the file, that names the focal length [mm] of a
  // camera of 35 mm film with the same view, as Apple's
  // com.apple.quicktime.camera.focal_length.35mm_equivalent; empty: there is none.
  std::string FocalLengthIn35mmFilm() const;

  // What the header says, or its duration times its frames a second; none if that is no number of
  // frames.
  std::optional<std::size_t> PromisedFrames() const;
  // Is that a count? A duration is that of the longest stream, be it the sound.
  bool CountsFrames() const;
  // How long the file is, by its header, after the frame that Next has decoded [s]; 0 without a
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

  // How the pictures are stored: transposed first, then mirrored.
  struct Orientation {
    bool transposed = false;
    bool mirrored_x = false;
    bool mirrored_y = false;
  };

  // What FFmpeg reads of.
  struct Source {
    Descriptor file;
    int error = 0;  // errno of a read that failed: to FFmpeg that is the end of the video, or a gap
  };

  static int Read(void* source, std::uint8_t* bytes, int count);
  static std::int64_t Seek(void* source, std::int64_t offset, int whence);
  int ShownWidth(int stored_width_px) const;
  void CheckSource() const;
  void OpenFile();
  void OpenStream();
  void Send();  // the next packet of the stream, or that there is none
  void Stamp();
  void MakeConverter();

  std::string name_;
  Source source_;
  // Each uses what stands before it.
  Owned<AVIOContext> io_;
  Owned<AVFormatContext> format_;
  Owned<AVCodecContext> codec_;
  Owned<AVPacket> packet_;
  Owned<AVFrame> frame_;
  Owned<AVFrame> bgr_;
  Owned<SwsContext> converter_;
  int stream_ = -1;
  int width_px_ = 0;  // what the converter is for
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
