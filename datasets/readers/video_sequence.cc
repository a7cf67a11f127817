#include "datasets/readers/video_sequence.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <opencv2/videoio.hpp>
#include <utility>

#include "datasets/readers/gray_image.h"
#include "frontend/core/error.h"
#include "frontend/core/input_file.h"

namespace cohort {
namespace {

constexpr double kDefaultFramesPerSecond = 30.0;  // where the file gives none

// Headers are often wrong by one frame, and a sound track that outlasts the picture makes
// containers that store only a duration promise too much: in a long clip one frame is no news.
bool EndsEarly(std::size_t decoded, std::size_t promised) {
  return decoded + 2 <= promised || decoded * 1.02 < promised;
}

// Lists of other files, and scripts that make them up, that FFmpeg takes for videos: what it would then
// read is not the file that was given, and a list without an end is waited for. Its own test looks at
// the first MiB, so these marks, of any case, are looked for there.
bool NamesOtherFiles(const Descriptor& file) {
  constexpr std::array<std::string_view, 4> kMarks{
      "#extm3u", "ffconcat version", "dash:profile", "<compositionplaylist"};
  std::string start(1 << 20, '\0');
  const ssize_t n = pread(file.get(), start.data(), start.size(), 0);
  start.resize(n > 0 ? static_cast<std::size_t>(n) : 0);
  for (char& c : start) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return std::ranges::any_of(
      kMarks, [&start](std::string_view mark) { return start.find(mark) != std::string::npos; });
}

class VideoSequence final : public Sequence {
 public:
  VideoSequence(const std::filesystem::path& file, const FrameRange& range)
      : file_(file.string()), name_(file.filename().string()), range_(range) {
    Rewind();
  }

  // Seeking is not exact in every container: opening again is.
  void Rewind() override {
    const Descriptor file = OpenInputDescriptor(file_);
    if (NamesOtherFiles(file)) {
      ThrowError("{} is a list of other files: give the video that it names", file_);
    }
    // Opened by its number: in names FFmpeg sees protocols (`http:`), patterns (`%d`) and scripts.
    if (!capture_.open(fmt::format("file:/proc/self/fd/{}", file.get()), cv::CAP_FFMPEG)) {
      ThrowError(
          "cannot open {} as a video: FFmpeg finds no video in it (an MP4 that was cut short has "
          "lost its index)",
          file_);
    }
    const double fps = capture_.get(cv::CAP_PROP_FPS);
    frames_per_second_ = std::isfinite(fps) && fps > 0.0 ? fps : kDefaultFramesPerSecond;
    const double frames = capture_.get(cv::CAP_PROP_FRAME_COUNT);
    if (!source_frames_ && frames >= 1.0 && frames < 1e9) {
      source_frames_ = static_cast<std::size_t>(frames);
    }
    grabbed_ = 0;
    next_ = range_.first;
    first_ = Decode();
    if (!first_ && grabbed_ == 0) ThrowError("no frame of {} can be decoded", file_);
    if (!first_) {
      ThrowError("{} has {} frames, the range starts at frame {}: give an earlier one",
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
  const std::map<FrameIndex, Rigid3>& TrueCamFromWorld() const override { return no_poses_; }
  std::optional<cv::Mat> TrueDepth(FrameIndex) const override { return std::nullopt; }
  std::optional<cv::Mat> OccluderMask(FrameIndex) const override { return std::nullopt; }
  const std::string& Warning() const override { return warning_; }

 private:
  std::optional<Frame> Decode() {
    if (range_.end && next_ >= *range_.end) return std::nullopt;
    for (; grabbed_ <= next_; ++grabbed_) {  // frames before the next one are not converted
      if (!capture_.grab()) return End();
    }
    cv::Mat picture;
    if (!capture_.retrieve(picture) || picture.empty()) return End();
    const std::size_t index = std::exchange(next_, next_ + range_.stride);
    const double seconds = static_cast<double>(index) / frames_per_second_;
    std::string name = fmt::format("frame_{:06}.png", index);
    Frame frame{FrameIndex(index), std::llround(seconds * 1e9), std::move(name), {}};
    SetPicture(std::move(picture), file_, frame);
    return frame;
  }

  std::optional<Frame> End() {
    if (source_frames_ && EndsEarly(grabbed_, *source_frames_)) {
      warning_ = fmt::format(
          "decoded {} frames of about {}: {} is cut short or damaged, or its header promises too "
          "many; the last frame may be incomplete",
          grabbed_,
          *source_frames_,
          file_);
    }
    source_frames_ = grabbed_;
    range_.end = static_cast<std::uint32_t>(grabbed_);
    return std::nullopt;
  }

  std::string file_;
  std::string name_;
  FrameRange range_;
  cv::VideoCapture capture_;
  double frames_per_second_ = kDefaultFramesPerSecond;
  std::optional<std::size_t> source_frames_;  // what the header says, from the end on what is there
  std::size_t grabbed_ = 0;                   // frames of the source behind us
  std::size_t next_ = 0;                      // frame of the source that Decode gives next
  std::optional<Frame> first_;                // decoded already when the file was opened
  cv::Size size_;
  std::string warning_;
  std::map<FrameIndex, Rigid3> no_poses_;
};

}  // namespace

std::unique_ptr<Sequence> OpenVideo(const std::filesystem::path& file, const FrameRange& range) {
  return std::make_unique<VideoSequence>(file, range);
}

}  // namespace cohort
