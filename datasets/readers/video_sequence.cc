#include "datasets/readers/video_sequence.h"

#include <cmath>
#include <string_view>
#include <utility>

#include "datasets/readers/gray_image.h"
#include "datasets/readers/interlacing.h"
#include "datasets/readers/video_decoder.h"
#include "frontend/core/error.h"
#include "frontend/tracks/frame_name.h"

namespace cohort {
namespace {

// Headers are often wrong by one frame, which is not worth a warning in a long clip. If they do not
// count frames, the time decides; but a sound track that is longer than the picture makes them
// promise up to a second too much.
bool EndsEarly(std::size_t decoded, std::size_t promised, const VideoDecoder& decoder) {
  if (decoder.CountsFrames()) return decoded + 2 <= promised || decoded * 1.02 < promised;
  const double frames_left = decoder.SecondsLeft() * decoder.FramesPerSecond();
  const double slack_frames = decoder.HasOtherStreams() ? decoder.FramesPerSecond() : 1.5;
  return frames_left > slack_frames && frames_left > 0.02 * static_cast<double>(decoded);
}

class VideoSequence final : public Sequence {
 public:
  VideoSequence(const std::filesystem::path& file, const FrameRange& range)
      : file_(file.string()), name_(file.filename().string()), range_(range) {
    if (const auto interlacing = InterlacingOf(file)) {
      field_order_ = interlacing->order;
      Warn(fmt::format("{} is interlaced{}, {} field first: its frames are deinterlaced",
                       file_,
                       interlacing->flagged ? "" : ", which it does not state",
                       field_order_ == FieldOrder::kTopFirst ? "top" : "bottom"));
    }
    Rewind();
    if (const std::string_view hdr = decoder_->Hdr(); !hdr.empty()) {
      Warn(
          fmt::format("{} is HDR video ({}): its frames are tone-mapped to 8-bit SDR", file_, hdr));
    }
    focal_guess_ =
        FocalGuessOfVideo(file, decoder_->FocalLengthIn35mmFilm(), {size_.width, size_.height});
    if (const double aspect = decoder_->PixelAspect(); aspect != 1.0) {
      Warn(
          fmt::format("the pixels of {} are not square but {:.3g} times as wide as high: its "
                      "frames are read as {}x{} with square pixels",
                      file_,
                      aspect,
                      size_.width,
                      size_.height));
    }
  }

  // Seeking is not exact in every container, but reopening is.
  void Rewind() override {
    decoder_.emplace(file_, field_order_);
    if (!source_frames_) source_frames_ = decoder_->PromisedFrames();
    grabbed_ = 0;
    next_ = range_.first;
    first_ = Decode();
    if (!first_ && grabbed_ == 0) {
      ThrowError("no frame of {} can be decoded: it is damaged, or frames have more than {} pixels",
                 file_,
                 VideoDecoder::kMaxPixels);
    }
    if (!first_) {
      ThrowError("{} has {} frames, but the range starts at frame {}: give an earlier one",
                 file_,
                 grabbed_,
                 range_.first);
    }
    size_ = first_->gray.size();
  }

  std::optional<Frame> Next() override {
    if (first_) return std::exchange(first_, std::nullopt);
    std::optional<Frame> frame = Decode();
    if (frame) RequireSize(frame->gray.size(), size_, fmt::format("{} of {}", frame->name, file_));
    return frame;
  }

  std::string Name() const override { return name_; }
  std::vector<std::filesystem::path> Files() const override { return {file_}; }
  std::filesystem::path ImageRoot() const override { return {}; }
  std::optional<std::size_t> FrameCount() const override {
    if (!source_frames_) return std::nullopt;
    return range_.Count(*source_frames_);
  }
  std::optional<Camera> KnownCamera() const override { return std::nullopt; }
  std::optional<FocalGuess> FocalGuessOfFile() const override { return focal_guess_; }
  RowOrder SensorRows() const override { return decoder_->SensorRows(); }
  const std::map<FrameIndex, Rigid3>& TrueCamFromWorld() const override { return no_poses_; }
  std::optional<cv::Mat> TrueDepth(FrameIndex) const override { return std::nullopt; }
  std::optional<cv::Mat> OccluderMask(FrameIndex) const override { return std::nullopt; }
  const std::string& Warning() const override { return warning_; }

 private:
  void Warn(const std::string& what) { warning_ += (warning_.empty() ? "" : "; ") + what; }

  std::optional<Frame> Decode() {
    if (range_.end && next_ >= *range_.end) return std::nullopt;
    for (; grabbed_ <= next_; ++grabbed_) {  // frames before the next one are not converted
      if (!decoder_->Next()) return End();
    }
    const std::size_t index = std::exchange(next_, next_ + range_.stride);
    const auto frame_index = static_cast<FrameIndex>(index);
    Frame frame{
        frame_index, std::llround(decoder_->Seconds() * 1e9), NumberedFrameName(frame_index), {}};
    SetPicture(decoder_->Picture(), file_, frame);
    frame.gray = decoder_->Gray();
    return frame;
  }

  std::optional<Frame> End() {
    if (source_frames_ && EndsEarly(grabbed_, *source_frames_, *decoder_)) {
      Warn(
          fmt::format("decoded {} frames of about {}: {} is truncated or damaged, or its header "
                      "announces too many; the last frame may be incomplete",
                      grabbed_,
                      *source_frames_,
                      file_));
    }
    source_frames_ = grabbed_;
    range_.end = static_cast<std::uint32_t>(grabbed_);
    return std::nullopt;
  }

  std::string file_;
  std::string name_;
  FrameRange range_;
  std::optional<FieldOrder> field_order_;  // of an interlaced video
  std::optional<VideoDecoder> decoder_;
  std::optional<std::size_t> source_frames_;  // the header's count; after the end, the actual one
  std::size_t grabbed_ = 0;                   // frames of the source read so far
  std::size_t next_ = 0;                      // frame of the source that Decode gives next
  std::optional<Frame> first_;                // decoded already when the file was opened
  cv::Size size_;
  std::optional<FocalGuess> focal_guess_;
  std::string warning_;
  std::map<FrameIndex, Rigid3> no_poses_;
};

}  // namespace

std::unique_ptr<Sequence> OpenVideo(const std::filesystem::path& file, const FrameRange& range) {
  return std::make_unique<VideoSequence>(file, range);
}

}  // namespace cohort
