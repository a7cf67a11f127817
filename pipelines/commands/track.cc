#include "pipelines/commands/track.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>

#include "frontend/track/tracker.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/console/interrupt.h"
#include "pipelines/console/progress_bar.h"
#include "pipelines/console/table.h"
#include "pipelines/console/version.h"
#include "pipelines/json/json_file.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

struct Figures {
  std::size_t frames = 0;
  std::size_t tracks = 0;
  std::size_t observations = 0;
  std::size_t predicted = 0;
  double mean_observed_length = 0.0;
  double decode_ms = 0.0;
  double detect_ms = 0.0;
  double track_ms = 0.0;
  double write_ms = 0.0;
  double second_pass_ms = 0.0;

  void Count(const TrackFile& file) {
    frames = file.frames.size();
    tracks = file.tracks.features().size();
    observations = file.tracks.observations().size();
    predicted = file.tracks.CountPredicted();
    mean_observed_length = file.tracks.MeanObservedLength();
  }
  double PerFrame(double ms) const { return frames == 0 ? 0.0 : ms / static_cast<double>(frames); }
};

double MsSince(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

// meta["second_pass"]: asked for, then what came of it.
constexpr const char* kSecondPassAsked = "asked";
constexpr const char* kSecondPassOff = "off";

std::string AbsoluteOrNone(const fs::path& path) {
  return path.empty() ? "" : fs::absolute(path).lexically_normal().string();
}

TrackFile Header(const TrackCommandOptions& options, const Sequence& sequence, const Frame& first) {
  TrackFile header;
  header.source = AbsoluteOrNone(options.input.input);
  header.image_root = AbsoluteOrNone(sequence.ImageRoot());
  header.width_px = first.gray.cols;
  header.height_px = first.gray.rows;
  header.camera = CameraOf(options.input, sequence, first.gray.cols, first.gray.rows);
  header.meta = {{"program", fmt::format("cohort {}", kVersion)},
                 {"tracker", std::string(NameOf(kTrackerNames, options.tracker.tracker))},
                 {"frames", options.input.frames},
                 {"mask", AbsoluteOrNone(options.mask)},
                 {"second_pass",
                  WantsSecondPass(options.second_pass.mode, options.tracker) ? kSecondPassAsked
                                                                             : kSecondPassOff},
                 {"options", ToJson(options.tracker).dump()}};
  if (header.meta.at("second_pass") == kSecondPassAsked) {
    header.meta["second_pass_options"] = ToJson(options.second_pass).dump();
  }
  return header;
}

// What an interrupted run of the same job has left.
struct EarlierRun {
  bool complete = false;
  bool second_pass_ended = false;  // or not asked for
  std::optional<FrameIndex> last_frame;
};

EarlierRun FindEarlierRun(const fs::path& out, const TrackFile& header) {
  const auto unfinished = FindUnfinishedTracks(out);
  if (!unfinished && !fs::exists(out)) return {};
  const fs::path path = unfinished.value_or(out);
  TrackFile earlier = ReadTrackFile(path);
  EarlierRun run;
  run.complete = !unfinished;
  const std::string asked = header.meta.at("second_pass");
  std::string& second_pass = earlier.meta["second_pass"];
  run.second_pass_ended = second_pass != kSecondPassAsked;
  if (second_pass != kSecondPassOff && asked != kSecondPassOff) second_pass = asked;
  if (earlier.source != header.source || earlier.meta != header.meta) {
    ThrowError(
        "cannot resume {}: it was made of another input or with other options; without "
        "--resume it is made anew",
        path.string());
  }
  if (!earlier.frames.empty()) run.last_frame = earlier.frames.back().index;
  return run;
}

nlohmann::ordered_json FiguresToJson(const Figures& figures, const TrackCommandOptions& options) {
  return {{"frames", figures.frames},
          {"tracks", figures.tracks},
          {"observations", figures.observations},
          {"predicted", figures.predicted},
          {"mean_track_length", figures.mean_observed_length},
          {"ms_per_frame",
           {{"decode", figures.PerFrame(figures.decode_ms)},
            {"detect", figures.PerFrame(figures.detect_ms)},
            {"track", figures.PerFrame(figures.track_ms)},
            {"write", figures.PerFrame(figures.write_ms)},
            {"second_pass", figures.PerFrame(figures.second_pass_ms)}}},
          {"options", ToJson(options)}};
}

void PrintFigures(const Figures& figures, const std::string& out) {
  fmt::print(
      "{}",
      AlignedTable(
          {{"tracks", out},
           {"frames", fmt::format("{}", figures.frames)},
           {"tracks", fmt::format("{}", figures.tracks)},
           {"observations", fmt::format("{}", figures.observations)},
           {"of them predicted", fmt::format("{}", figures.predicted)},
           {"mean observed track length", fmt::format("{:.1f}", figures.mean_observed_length)},
           {"decode [ms/frame]", fmt::format("{:.2f}", figures.PerFrame(figures.decode_ms))},
           {"detect [ms/frame]", fmt::format("{:.2f}", figures.PerFrame(figures.detect_ms))},
           {"track [ms/frame]", fmt::format("{:.2f}", figures.PerFrame(figures.track_ms))},
           {"write [ms/frame]", fmt::format("{:.2f}", figures.PerFrame(figures.write_ms))},
           {"second pass [ms/frame]",
            fmt::format("{:.2f}", figures.PerFrame(figures.second_pass_ms))}}));
}

// Frame by frame into `writer`; `frame` is the first.
void TrackFrames(const TrackCommandOptions& options,
                 const cv::Mat& mask,
                 Sequence& sequence,
                 std::optional<Frame> frame,
                 const std::optional<FrameIndex>& last_written,
                 TrackWriter& writer,
                 Figures& figures) {
  const auto tracker = MakeTracker(options.tracker, mask);
  const InterruptGuard interrupt;
  ProgressBar progress("track", sequence.FrameCount());
  while (frame && !interrupt.Requested()) {
    Clock::time_point start = Clock::now();
    const FrameResult result = tracker->Track(*frame);
    ++figures.frames;
    figures.detect_ms += result.detect_ms;
    figures.track_ms += MsSince(start) - result.detect_ms;

    // A resumed run tracks the finished frames once more, for the tracker's memory: the file
    // becomes the same as without the interruption.
    start = Clock::now();
    if (!last_written || frame->index > *last_written) {
      writer.AppendFrame(
          {frame->index, frame->name, frame->timestamp_ns}, result.observations, result.ends);
    }
    figures.write_ms += MsSince(start);
    progress.Advance();
    start = Clock::now();
    frame = sequence.Next();
    figures.decode_ms += MsSince(start);
  }
  if (frame) {
    ThrowError(
        "interrupted after {} frames, which are kept: the same command with --resume goes on",
        figures.frames);
  }
}

}  // namespace

cv::Mat ReadMask(const std::string& path) {
  if (path.empty()) return {};
  cv::Mat mask = cv::imread(path, cv::IMREAD_GRAYSCALE);
  if (mask.empty()) ThrowError("cannot read the mask {}: give a picture", path);
  return mask;
}

bool WantsSecondPass(SecondPassMode mode, const TrackerOptions& tracker) {
  switch (mode) {
    case SecondPassMode::kAuto:
      return tracker.tracker == TrackerKind::kSubspace &&
             tracker.subspace.constraint == Constraint::kStrong && tracker.measurement.enabled &&
             !tracker.measurement.fuse;
    case SecondPassMode::kOn:
      return true;
    case SecondPassMode::kOff:
      return false;
  }
  return false;
}

void RunTrack(const TrackCommandOptions& options) {
  cv::setNumThreads(options.threads == 0 ? -1 : options.threads);
  const auto sequence = OpenInput(options.input);
  const cv::Mat mask = ReadMask(options.mask);

  Figures figures;
  Clock::time_point start = Clock::now();
  std::optional<Frame> frame = sequence->Next();
  figures.decode_ms += MsSince(start);
  if (!frame) ThrowError("{}: no frame to track. {}", options.input.input, sequence->Warning());
  const TrackFile header = Header(options, *sequence, *frame);
  const EarlierRun earlier = options.resume ? FindEarlierRun(options.out, header) : EarlierRun{};
  if (earlier.complete && earlier.second_pass_ended) {
    spdlog::info("{} is complete already", options.out);
    return;
  }
  if (!earlier.complete) {
    TrackWriter writer = earlier.last_frame ? TrackWriter::Resume(options.out)
                                            : TrackWriter::Create(options.out, header);
    TrackFrames(options, mask, *sequence, std::move(frame), earlier.last_frame, writer, figures);
    writer.Finish();
    if (!sequence->Warning().empty()) spdlog::warn("{}", sequence->Warning());
  }
  TrackFile file = ReadTrackFile(options.out);
  if (header.meta.at("second_pass") == kSecondPassAsked) {
    start = Clock::now();
    file = WithSecondPass(std::move(file), *sequence, mask, options.second_pass);
    WriteTrackFile(options.out, file);
    figures.second_pass_ms = MsSince(start);
  }
  figures.Count(file);
  if (!options.json.empty()) WriteJsonFile(options.json, FiguresToJson(figures, options));
  PrintFigures(figures, options.out);
}

Command TrackCommand() {
  return MakeCommand({.name = "track",
                      .usage = "INPUT --out F.tracks [options]",
                      .summary = "Track features through a video",
                      .positionals = {"input"},
                      .required = {"input", "out"},
                      .short_flags = {{"features", {"detector.max_features"}},
                                      {"history", {"subspace.history_length"}},
                                      {"window",
                                       {"klt.window_px", "subspace.template_px"},
                                       "The side of the patch of tracker klt and of the template "
                                       "of subspace and descent [px], odd. A larger one has less "
                                       "noise, but more often lies on two surfaces."},
                                      {"constraint", {"subspace.constraint"}},
                                      {"penalty", {"subspace.penalty"}},
                                      {"uncentered", {"subspace.uncentered"}},
                                      {"second-pass", {"second_pass.mode"}}}},
                     RunTrack);
}

}  // namespace cohort
