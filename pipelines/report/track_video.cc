#include "pipelines/report/track_video.h"

#include <fcntl.h>
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <set>
#include <string>

#include "datasets/degrade/video_encoder.h"
#include "datasets/open_sequence.h"
#include "frontend/core/child_process.h"
#include "frontend/core/error.h"
#include "frontend/storage/input_record.h"
#include "frontend/storage/output.h"
#include "pipelines/report/brightening.h"
#include "pipelines/report/track_picture.h"
#include "pipelines/sfm/for_each_frame.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

constexpr int kCaptionPx = 44;
constexpr int kMostSidePx = 16384;  // of H.264

std::string TrackerOf(const TrackFile& file) {
  if (file.meta.tracker.empty()) return "tracks";
  return file.meta.tracker + (file.meta.second_pass ? ", both passes" : "");
}

// Noise distracts viewers and takes most of a video's bytes.
cv::Mat Smooth(const cv::Mat& gray) {
  constexpr double kSigmaPx = 1.0;
  cv::Mat smooth;
  cv::GaussianBlur(gray, smooth, {}, kSigmaPx);
  return smooth;
}

cv::Mat Panel(const TrackFile& file, const cv::Mat& picture, FrameIndex frame, int width_px) {
  TrackPicture drawn = DrawTracks(picture, frame, file.tracks, nullptr);
  if (width_px > 0 && width_px != drawn.picture.cols) {
    const double scale = static_cast<double>(width_px) / drawn.picture.cols;
    const cv::Size size(std::max(2, width_px), std::max(2, cvRound(scale * drawn.picture.rows)));
    cv::resize(drawn.picture, drawn.picture, size, 0.0, 0.0, cv::INTER_AREA);
  }
  // H.264 supports only even sizes, so a width or height of one pixel becomes two.
  const int more_rows = drawn.picture.rows < 2 ? 1 : 0;
  const int more_cols = drawn.picture.cols < 2 ? 1 : 0;
  if (more_rows + more_cols > 0) {
    cv::copyMakeBorder(
        drawn.picture, drawn.picture, 0, more_rows, 0, more_cols, cv::BORDER_REPLICATE);
  }
  const int width = drawn.picture.cols / 2 * 2;
  const int height = drawn.picture.rows / 2 * 2;
  cv::Mat panel(height + kCaptionPx, width, CV_8UC3, cv::Scalar::all(255));
  drawn.picture(cv::Rect(0, 0, width, height))
      .copyTo(panel(cv::Rect(0, kCaptionPx, width, height)));
  cv::putText(panel,
              TrackerOf(file),
              {4, 17},
              cv::FONT_HERSHEY_DUPLEX,
              0.55,
              cv::Scalar::all(20),
              1,
              cv::LINE_AA);
  cv::putText(
      panel,
      fmt::format(
          "frame {}: {} observed, {} predicted", ToInt(frame), drawn.observed, drawn.predicted),
      {4, 37},
      cv::FONT_HERSHEY_DUPLEX,
      0.45,
      cv::Scalar::all(90),
      1,
      cv::LINE_AA);
  return panel;
}

std::vector<FrameInfo> FramesOfAll(const std::vector<TrackFile>& files) {
  std::vector<FrameInfo> common = files.front().frames;
  for (const TrackFile& file : files) {
    std::set<FrameIndex> own;
    for (const FrameInfo& frame : file.frames) own.insert(frame.index);
    std::erase_if(common, [&](const FrameInfo& frame) { return !own.contains(frame.index); });
  }
  if (common.empty()) ThrowError("the tracks have no frame in common: give tracks of one clip");
  return common;
}

// cv::VideoWriter does not report a full disk. `name`, here and below: the path in messages.
void CheckVideo(const fs::path& path, const std::string& name, std::size_t frames) {
  const OwnFile own(path);
  std::size_t written = 0;
  try {
    const auto video = OpenSequence(path.string(), Layout::kVideo);
    while (video->Next()) ++written;
  } catch (const Error&) {  // not even its header can be read
  }
  if (written != frames) {
    ThrowError(
        "cannot write {}: {} of {} frames arrived; is the disk full?", name, written, frames);
  }
}

void WriteMp4(const fs::path& path,
              const std::string& name,
              const std::vector<TrackFile>& files,
              Sequence& sequence,
              double frames_per_second,
              int width_px,
              const StageProgress& progress) {
  const std::vector<FrameInfo> wanted = FramesOfAll(files);
  std::vector<IntensityRange> ranges;
  ForEachFrame(files.front(), wanted, sequence, "look", progress, [&](const Frame& frame) {
    ranges.push_back(IntensityRangeOf(Smooth(frame.gray)));
  });
  ranges = Steadied(ranges, kSteadyFrames);
  cv::VideoWriter writer;
  auto range = ranges.begin();
  ForEachFrame(files.front(), wanted, sequence, "show", progress, [&](const Frame& frame) {
    const cv::Mat bright = Brightened(Smooth(frame.gray), *range++);
    std::vector<cv::Mat> panels;
    for (const TrackFile& file : files) {
      panels.push_back(Panel(file, bright, frame.index, width_px));
    }
    cv::Mat picture;
    cv::hconcat(panels, picture);
    if (std::max(picture.cols, picture.rows) > kMostSidePx) {
      ThrowError(
          "cannot write {}: its pictures would be {}x{}, but H.264 supports {} at most: give a "
          "smaller --width-px",
          name,
          picture.cols,
          picture.rows,
          kMostSidePx);
    }
    if (!writer.isOpened() && !writer.open(path.string(),
                                           cv::CAP_FFMPEG,
                                           cv::VideoWriter::fourcc('a', 'v', 'c', '1'),
                                           frames_per_second,
                                           picture.size())) {
      ThrowError(
          "cannot write {}: OpenCV's FFmpeg cannot start an H.264 video: it has no encoder, the "
          "system has no threads or memory left, or the disk is full",
          name);
    }
    writer.write(picture);
  });
  writer.release();
  CheckVideo(path, name, wanted.size());
}

bool IsWholeGif(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  std::string begin(6, '\0');
  in.read(begin.data(), static_cast<std::streamsize>(begin.size()));
  in.seekg(-1, std::ios::end);
  return begin == "GIF89a" && in.get() == ';';
}

void ToGif(const fs::path& video,
           const fs::path& gif,
           const std::string& name,
           std::size_t frames) {
  const auto ffmpeg = FindProgram("ffmpeg");
  if (!ffmpeg)
    ThrowError("a GIF needs the program ffmpeg: install it, or give a name that ends in .mp4");
  const Descriptor null(open("/dev/null", O_WRONLY | O_CLOEXEC));
  const ProgramEnd end =
      RunProgram(*ffmpeg,
                 {"-loglevel",
                  "error",
                  "-y",
                  "-i",
                  video.string(),
                  "-filter_complex",
                  "split[a][b];[a]palettegen=max_colors=64[p];[b][p]paletteuse=dither=none",
                  "-f",
                  "gif",
                  gif.string()},
                 null.get(),
                 FfmpegLimit(frames));
  if (end.out_of_time) ThrowError("cannot write {}: ffmpeg hangs, and was killed", name);
  if (end.Failed() || !IsWholeGif(gif)) {
    ThrowError("cannot write {}: ffmpeg ended with {}; is the disk full?", name, end.Brief());
  }
}

}  // namespace

void WriteTrackVideo(const fs::path& path,
                     const std::vector<TrackFile>& files,
                     Sequence& sequence,
                     double frames_per_second,
                     int width_px,
                     const StageProgress& progress) {
  if (path.extension() != ".mp4" && path.extension() != ".gif") {
    ThrowUsageError("{}: give a name that ends in .mp4 or .gif or, for a page, in .html",
                    path.string());
  }
  constexpr double kFastestGif = 50.0;  // viewers play the next possible rate, 100/s, at 10/s
  if (path.extension() == ".gif" && frames_per_second > kFastestGif) {
    ThrowUsageError(
        "a GIF shows at most {:g} frames a second: give fewer, or a name that ends in .mp4",
        kFastestGif);
  }
  // Absolute, because FFmpeg takes parts of other names as protocols, and its program takes them as
  // options.
  OutputFile out(fs::absolute(path));
  // FFmpeg chooses the format by the file name's ending.
  const fs::path video = out.partial().string() + ".mp4";
  WriteLock::OfNewFile(video);
  struct Remove {
    const fs::path& path;
    ~Remove() {
      std::error_code ignored;
      fs::remove(path, ignored);
    }
  } const remove{video};
  WriteMp4(video, path.string(), files, sequence, frames_per_second, width_px, progress);
  if (path.extension() == ".gif") {
    ToGif(video, out.partial(), path.string(), FramesOfAll(files).size());
  } else {
    fs::rename(video, out.partial());
    out.LockAnew();
  }
  out.Commit();
}

}  // namespace cohort
