#include "pipelines/jobs/track_job.h"

#include <spdlog/spdlog.h>

#include <future>
#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <utility>

#include "frontend/core/stopwatch.h"
#include "frontend/core/worker.h"
#include "frontend/geometry/camera_text.h"
#include "frontend/storage/input_file.h"
#include "frontend/storage/input_record.h"
#include "frontend/storage/output.h"
#include "pipelines/console/interrupt.h"
#include "pipelines/console/progress_bar.h"
#include "pipelines/console/version.h"
#include "pipelines/jobs/idle_options.h"
#include "pipelines/jobs/track_doubts.h"
#include "pipelines/json/json_file.h"
#include "pipelines/json/option_list.h"
#include "pipelines/sfm/cuts.h"
#include "pipelines/sfm/fingerprint.h"
#include "pipelines/sfm/track_sequence.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

void Count(const fs::path& tracks, TrackFigures& figures) {
  const TrackCounts counts = CountTracks(tracks);
  figures.frames = counts.frames;
  figures.tracks = counts.tracks;
  figures.observations = counts.observations;
  figures.predicted = counts.predicted;
  if (counts.tracks == 0) return;
  figures.mean_observed_length = static_cast<double>(counts.observations - counts.predicted) /
                                 static_cast<double>(counts.tracks);
}

TrackFile DescribeJob(const TrackJobOptions& options,
                      const Sequence& sequence,
                      const SequenceTracker& tracker) {
  TrackFile header = tracker.Header();
  DescribeInput(options.input, sequence, header);
  header.meta["program"] = fmt::format("cohort {}", kVersion);
  NoteMask(options.mask, header);
  return header;
}

bool SameCamera(const std::optional<Camera>& a, const std::optional<Camera>& b) {
  if (!a || !b) return a.has_value() == b.has_value();
  return a->known == b->known && a->guess_log_sigma == b->guess_log_sigma &&
         WordsOfCamera(*a) == WordsOfCamera(*b);
}

// What an interrupted run of the same job has left.
struct EarlierRun {
  bool complete = false;
  bool unfinished = false;         // where it is complete: it only lacks its name
  bool second_pass_ended = false;  // or not asked for
  bool has_frames = false;
  std::vector<FrameIndex> cuts;
};

bool SecondPassEnded(const TrackFile& file) {
  const auto second_pass = file.meta.find("second_pass");
  return second_pass == file.meta.end() || second_pass->second != kSecondPassAsked;
}

// Was the file made of the same, with the same options? What a run found does not count, nor how
// far it came.
bool IsOfJob(const TrackFile& file, const TrackFile& header) {
  std::map<std::string, std::string> meta = file.meta;
  const std::string& asked = header.meta.at("second_pass");
  std::string& second_pass = meta["second_pass"];
  if (second_pass != kSecondPassOff && asked != kSecondPassOff) second_pass = asked;
  meta.erase(kCutsMeta);
  meta.erase(kWarningMeta);
  return CanonicalPath(file.source) == CanonicalPath(header.source) && meta == header.meta &&
         SameCamera(file.camera, header.camera);
}

EarlierRun FindEarlierRun(const fs::path& out, const TrackFile& header) {
  const auto unfinished = FindUnfinishedTracks(out);
  // A link is replaced, and nothing written through it.
  if (!unfinished && (!fs::exists(out) || fs::is_symlink(out))) return {};
  const fs::path path = unfinished.value_or(out);
  TrackFile earlier;
  try {
    earlier = ReadTrackFile(path);
  } catch (const MissingFileError&) {  // another run ended, and so renamed it, in this moment
    return FindEarlierRun(out, header);
  }
  EarlierRun run;
  run.complete = earlier.complete;
  run.unfinished = unfinished.has_value();
  run.second_pass_ended = SecondPassEnded(earlier);
  if (!IsOfJob(earlier, header)) {
    ThrowError(
        "cannot resume {}: it was made of another input or with other options; without "
        "--resume it is made anew",
        path.string());
  }
  run.has_frames = !earlier.frames.empty();
  if (run.complete) run.cuts = CutsOf(earlier);
  if (run.complete && run.second_pass_ended) WarnAgain(earlier);
  return run;
}

// Into the file and the log.
void TellCuts(const std::vector<FrameIndex>& cuts,
              FrameIndex first,
              std::uint32_t stride,
              TrackWriter& writer) {
  if (cuts.empty()) return;
  std::map<std::string, std::string> meta;
  NoteCuts(cuts, meta);
  writer.SetMeta(kCutsMeta, meta.at(kCutsMeta));
  spdlog::warn(
      "the clip is cut at {}: all tracks end there. Give its scenes one by one: --frames {}:{}{} "
      "is the first",
      CutsText(cuts),
      ToInt(first),
      ToInt(cuts.front()),
      stride > 1 ? fmt::format(":{}", stride) : "");
}

// To --json, if it is given. Where all was done already there are no times.
void WriteFigures(const TrackFigures& figures, const TrackJobOptions& options) {
  if (options.json.empty()) return;
  nlohmann::ordered_json times;
  if (figures.track_ms > 0.0 || figures.second_pass_ms > 0.0) {
    times = {{"decode", figures.PerFrame(figures.decode_ms)},
             {"detect", figures.PerFrame(figures.detect_ms)},
             {"track", figures.PerFrame(figures.track_ms)},
             {"write", figures.PerFrame(figures.write_ms)},
             {"second_pass", figures.PerFrame(figures.second_pass_ms)}};
  }
  WriteJsonFile(options.json,
                {{"frames", figures.frames},
                 {"tracks", figures.tracks},
                 {"observations", figures.observations},
                 {"predicted", figures.predicted},
                 {"mean_track_length", figures.mean_observed_length},
                 {"cuts", NumbersOf(figures.cuts)},
                 {"ms_per_frame", times},
                 {"options", ToJson(options)}});
}

[[noreturn]] void ThrowInterrupted(std::size_t frames) {
  ThrowError("interrupted after {} frames, which are kept: the same command with --resume goes on",
             frames);
}

// Frame by frame into `writer`, which may have the first ones. False: an interruption came with the
// last one.
bool TrackFrames(SequenceTracker& tracker,
                 const Sequence& sequence,
                 TrackWriter& writer,
                 TrackFigures& figures) {
  const std::optional<FrameIndex> last_written = writer.last_frame();
  const InterruptGuard interrupt;
  ProgressBar progress("track", sequence.FrameCount());
  // A frame is written while the next one is tracked, where there are threads for both.
  const bool overlaps = cv::getNumThreads() > 1;
  std::future<void> written;
  Worker worker;
  FrameIndex first{};
  FrameIndex last{};
  std::uint32_t stride = 1;
  const auto finish = [&] {
    const Stopwatch stopwatch;
    if (written.valid()) written.get();
    figures.write_ms += stopwatch.Milliseconds();
  };
  while (tracker.HasNext() && !interrupt.Requested()) {
    TrackedFrame frame = tracker.TrackNext();
    finish();
    if (figures.frames == 0) first = frame.info.index;
    if (figures.frames == 1) stride = ToInt(frame.info.index) - ToInt(first);
    last = frame.info.index;
    if (frame.result.cut) figures.cuts.push_back(frame.info.index);
    ++figures.frames;
    progress.Advance();
    // A resumed run tracks the finished frames once more, for the tracker's memory: the file
    // becomes the same as without the interruption.
    if (last_written && frame.info.index <= *last_written) continue;
    auto write = [&writer, frame = std::move(frame)] {
      writer.AppendFrame(frame.info, frame.result.observations, frame.result.ends);
    };
    if (overlaps) {
      written = worker.Begin(std::move(write));
    } else {
      const Stopwatch stopwatch;
      write();
      figures.write_ms += stopwatch.Milliseconds();
    }
  }
  finish();
  if (tracker.HasNext() && last_written && last <= *last_written) {
    ThrowError(
        "interrupted; the frames of the run before are kept: the same command with --resume "
        "goes on");
  }
  if (tracker.HasNext()) ThrowInterrupted(figures.frames);
  TellCuts(figures.cuts, first, stride, writer);
  return !interrupt.Requested();
}

// Also in the log; empty: nothing.
std::string WhatWasWrong(const Sequence& sequence,
                         const TrackFile& header,
                         const std::string& input) {
  std::string warning = WarningOfClip(sequence, header, input);
  if (!warning.empty()) spdlog::warn("{}", warning);
  return warning;
}

}  // namespace

void WarnAgain(const TrackFile& tracks) {
  const auto warning = tracks.meta.find(kWarningMeta);
  if (warning == tracks.meta.end()) return;
  spdlog::warn("{}; without --resume it is made anew", warning->second);
}

TrackFile RunSecondPass(TrackFile file,
                        Sequence& sequence,
                        const cv::Mat& mask,
                        const SecondPassOptions& options) {
  SecondPass second = WithSecondPass(std::move(file), sequence, mask, options, ProgressBars());
  if (second.none_because.empty()) {
    spdlog::info("second pass: {}", second.figures.Brief());
  } else {
    spdlog::warn("no second pass: {}", second.none_because);
  }
  return std::move(second.file);
}

std::optional<TrackFigures> RunTrackJob(const TrackJobOptions& options) {
  cv::setNumThreads(options.threads == 0 ? -1 : options.threads);
  CheckDistinctOutputs({{"--out", options.out}, {"--json", options.json}});
  const auto sequence = OpenInput(options.input);
  CheckOutputsGiven({options.json});
  const cv::Mat mask = ReadMask(options.mask);
  SequenceTracker tracker(*sequence,
                          {.tracker = options.tracker,
                           .second_pass = options.second_pass,
                           .mask = mask,
                           .source = options.input.input});
  const TrackFile header = DescribeJob(options, *sequence, tracker);
  const OwnFile own(options.out);
  const OwnFile own_partial(PartialOf(options.out));
  const EarlierRun earlier = options.resume ? FindEarlierRun(options.out, header) : EarlierRun{};
  // The end came when all was written and nothing renamed.
  if (earlier.complete && earlier.unfinished) {
    if (auto writer = TrackWriter::Resume(options.out)) writer->Finish();
  }
  TrackFigures figures;
  figures.cuts = earlier.cuts;
  if (earlier.complete && earlier.second_pass_ended) {
    spdlog::info("{} is complete already", options.out);
    if (options.json.empty()) return std::nullopt;
    Count(options.out, figures);
    WriteFigures(figures, options);
    return std::nullopt;
  }
  WarnIfCameraDoubtful(header.camera);
  TellFocalGuess(header);
  WarnOfIdleOptions(options.tracker);
  if (!earlier.complete) {
    std::optional<TrackWriter> writer = earlier.has_frames
                                            ? TrackWriter::Resume(options.out)
                                            : TrackWriter::Create(options.out, header);
    if (!writer) return RunTrackJob(options);  // another run has ended it in the meantime
    const bool goes_on = TrackFrames(tracker, *sequence, *writer, figures);
    const std::string warning = WhatWasWrong(*sequence, header, options.input.input);
    if (!warning.empty()) writer->SetMeta(kWarningMeta, warning);
    writer->Finish();
    if (!goes_on && header.meta.at("second_pass") == kSecondPassAsked) {
      ThrowInterrupted(figures.frames);
    }
  }
  figures.decode_ms = tracker.decode_ms();
  figures.detect_ms = tracker.detect_ms();
  figures.track_ms = tracker.track_ms();
  if (header.meta.at("second_pass") == kSecondPassAsked) {
    const Stopwatch stopwatch;
    TrackFileOutput out(options.out);
    TrackFile file = ReadTrackFile(options.out);
    if (!IsOfJob(file, header)) {
      ThrowError("{} was replaced by another run after the first pass; give another output",
                 options.out);
    }
    // Another run that resumed may have made it while this one waited for the file.
    if (!SecondPassEnded(file)) {
      file = RunSecondPass(std::move(file), *sequence, mask, options.second_pass);
      if (!file.meta.contains(kWarningMeta)) {  // the clip may have gone since
        const std::string warning = WhatWasWrong(*sequence, header, options.input.input);
        if (!warning.empty()) file.meta[kWarningMeta] = warning;
      }
      out.Write(file);
      figures.second_pass_ms = stopwatch.Milliseconds();
    }
  }
  Count(options.out, figures);
  WriteFigures(figures, options);
  return figures;
}

}  // namespace cohort
