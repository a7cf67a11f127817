#include "pipelines/commands/track.h"

#include <spdlog/spdlog.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <opencv2/imgcodecs.hpp>
#include <unordered_set>

#include "frontend/track/tracker.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/console/interrupt.h"
#include "pipelines/console/json_file.h"
#include "pipelines/console/progress_bar.h"
#include "pipelines/console/table.h"
#include "pipelines/console/version.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

struct Figures {
  std::size_t frames = 0;
  std::unordered_set<std::uint32_t> features;
  std::size_t observations = 0;
  std::size_t predicted = 0;
  double decode_ms = 0.0;
  double detect_ms = 0.0;
  double track_ms = 0.0;
  double write_ms = 0.0;

  void Count(const FrameResult& result) {
    ++frames;
    for (const Observation& observation : result.observations) {
      features.insert(ToInt(observation.feature));
      ++observations;
      if (observation.state == ObservationState::kPredicted) ++predicted;
    }
  }
  double MeanObservedLength() const {
    return features.empty() ? 0.0
                            : static_cast<double>(observations - predicted) /
                                  static_cast<double>(features.size());
  }
  double PerFrame(double ms) const { return frames == 0 ? 0.0 : ms / static_cast<double>(frames); }
};

double MsSince(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

cv::Mat ReadMask(const std::string& path) {
  if (path.empty()) return {};
  cv::Mat mask = cv::imread(path, cv::IMREAD_GRAYSCALE);
  if (mask.empty()) ThrowError("cannot read the mask {}: give a picture", path);
  return mask;
}

TrackFile Header(const TrackCommandOptions& options, const Sequence& sequence, const Frame& first) {
  TrackFile header;
  header.source = fs::absolute(options.input.input).lexically_normal().string();
  if (!sequence.ImageRoot().empty()) {
    header.image_root = fs::absolute(sequence.ImageRoot()).lexically_normal().string();
  }
  header.width_px = first.gray.cols;
  header.height_px = first.gray.rows;
  header.camera = CameraOf(options.input, sequence, first.gray.cols, first.gray.rows);
  header.meta = {{"program", fmt::format("cohort {}", kVersion)},
                 {"tracker", std::string(NameOf(kTrackerNames, options.tracker.tracker))},
                 {"frames", options.input.frames},
                 {"mask", options.mask},
                 {"options", ToJson(options.tracker).dump()}};
  return header;
}

// What an interrupted run of the same job has left.
struct EarlierRun {
  bool complete = false;
  std::optional<FrameIndex> last_frame;
};

EarlierRun FindEarlierRun(const fs::path& out, const TrackFile& header) {
  const auto unfinished = FindUnfinishedTracks(out);
  if (!unfinished && !fs::exists(out)) return {};
  const fs::path path = unfinished.value_or(out);
  const TrackFile earlier = ReadTrackFile(path);
  if (earlier.source != header.source || earlier.meta != header.meta) {
    ThrowError(
        "cannot resume {}: it was made of another input or with other options; without "
        "--resume it is made anew",
        path.string());
  }
  EarlierRun run;
  run.complete = !unfinished;
  if (!earlier.frames.empty()) run.last_frame = earlier.frames.back().index;
  return run;
}

nlohmann::ordered_json FiguresToJson(const Figures& figures, const TrackCommandOptions& options) {
  return {{"frames", figures.frames},
          {"tracks", figures.features.size()},
          {"observations", figures.observations},
          {"predicted", figures.predicted},
          {"mean_track_length", figures.MeanObservedLength()},
          {"ms_per_frame",
           {{"decode", figures.PerFrame(figures.decode_ms)},
            {"detect", figures.PerFrame(figures.detect_ms)},
            {"track", figures.PerFrame(figures.track_ms)},
            {"write", figures.PerFrame(figures.write_ms)}}},
          {"options", ToJson(options)}};
}

void PrintFigures(const Figures& figures, const std::string& out) {
  fmt::print(
      "{}",
      AlignedTable(
          {{"tracks", out},
           {"frames", fmt::format("{}", figures.frames)},
           {"tracks", fmt::format("{}", figures.features.size())},
           {"observations", fmt::format("{}", figures.observations)},
           {"of them predicted", fmt::format("{}", figures.predicted)},
           {"mean observed track length", fmt::format("{:.1f}", figures.MeanObservedLength())},
           {"decode [ms/frame]", fmt::format("{:.2f}", figures.PerFrame(figures.decode_ms))},
           {"detect [ms/frame]", fmt::format("{:.2f}", figures.PerFrame(figures.detect_ms))},
           {"track [ms/frame]", fmt::format("{:.2f}", figures.PerFrame(figures.track_ms))},
           {"write [ms/frame]", fmt::format("{:.2f}", figures.PerFrame(figures.write_ms))}}));
}

}  // namespace

void RunTrack(const TrackCommandOptions& options) {
  cv::setNumThreads(options.threads == 0 ? -1 : options.threads);
  const auto sequence = OpenInput(options.input);
  const auto tracker = MakeTracker(options.tracker, ReadMask(options.mask));

  Clock::time_point start = Clock::now();
  std::optional<Frame> frame = sequence->Next();
  if (!frame) ThrowError("{}: no frame to track. {}", options.input.input, sequence->Warning());
  const TrackFile header = Header(options, *sequence, *frame);
  const EarlierRun earlier = options.resume ? FindEarlierRun(options.out, header) : EarlierRun{};
  if (earlier.complete) {
    spdlog::info("{} is complete already", options.out);
    return;
  }
  TrackWriter writer = earlier.last_frame ? TrackWriter::Resume(options.out)
                                          : TrackWriter::Create(options.out, header);

  Figures figures;
  const InterruptGuard interrupt;
  {
    ProgressBar progress("track", sequence->FrameCount());
    while (frame && !interrupt.Requested()) {
      figures.decode_ms += MsSince(start);
      start = Clock::now();
      const FrameResult result = tracker->Track(*frame);
      figures.detect_ms += result.detect_ms;
      figures.track_ms += MsSince(start) - result.detect_ms;
      figures.Count(result);

      // A resumed run tracks the finished frames once more, for the tracker's memory: the file
      // becomes the same as without the interruption.
      start = Clock::now();
      if (!earlier.last_frame || frame->index > *earlier.last_frame) {
        writer.AppendFrame(
            {frame->index, frame->name, frame->timestamp_ns}, result.observations, result.ends);
      }
      figures.write_ms += MsSince(start);
      progress.Advance();
      start = Clock::now();
      frame = sequence->Next();
    }
  }
  if (frame) {
    ThrowError(
        "interrupted after {} frames, which are kept: the same command with --resume goes on",
        figures.frames);
  }
  writer.Finish();
  if (!sequence->Warning().empty()) spdlog::warn("{}", sequence->Warning());
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
                                      {"window", {"klt.window_px", "subspace.template_px"}},
                                      {"constraint", {"subspace.constraint"}},
                                      {"penalty", {"subspace.penalty"}},
                                      {"uncentered", {"subspace.uncentered"}}}},
                     RunTrack);
}

}  // namespace cohort
