#include "pipelines/sfm/track_clip.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <opencv2/core/utility.hpp>
#include <utility>

#include "frontend/core/stopwatch.h"
#include "frontend/geometry/camera_text.h"
#include "frontend/storage/input_file.h"
#include "frontend/storage/output.h"
#include "pipelines/json/json_file.h"
#include "pipelines/json/option_list.h"
#include "pipelines/sfm/cuts.h"
#include "pipelines/sfm/doubts.h"
#include "pipelines/sfm/idle_options.h"
#include "pipelines/sfm/repeated_frames.h"
#include "pipelines/sfm/track_sequence.h"
#include "pipelines/sfm/version.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

void CountTracks(const TrackFile& file, TrackFigures& figures) {
  figures.frames = file.FrameCount();
  figures.repeats = file.repeats.size();
  figures.tracks = file.tracks.features().size();
  figures.observations = file.tracks.observations().size();
  figures.predicted = file.tracks.CountPredicted();
  figures.mean_observed_length = file.tracks.MeanObservedLength();
}

TrackFile HeaderOf(const TrackClipOptions& options,
                   const MaskedSequence& sequence,
                   const SequenceTracker& tracker) {
  TrackFile header = tracker.Header();
  DescribeInput(options.input, sequence, header);
  header.meta.program = fmt::format("cohort {}", kVersion);
  NoteMask(options.masks.mask, header);
  NoteFixedParts(options.masks, sequence, header);
  return header;
}

bool SameCamera(const std::optional<Camera>& a, const std::optional<Camera>& b) {
  if (!a || !b) return a.has_value() == b.has_value();
  return a->known == b->known && a->guess_log_sigma == b->guess_log_sigma &&
         WordsOfCamera(*a) == WordsOfCamera(*b);
}

// Whether the file was made from the same input with the same options. What a run found does not
// count.
bool AgreesWith(const TrackFile& file, const TrackFile& header) {
  const auto asked = [](TrackMeta meta) {
    meta.second_pass = false;
    meta.no_second_pass.clear();
    meta.warning.clear();
    meta.cuts.clear();
    if (meta.fixed_parts == kFixedPartsMasked) meta.fixed_parts.clear();
    return meta;
  };
  return CanonicalPath(file.source) == CanonicalPath(header.source) &&
         asked(file.meta) == asked(header.meta) && SameCamera(file.camera, header.camera);
}

std::string DescribeCuts(const TrackFile& file) {
  const std::vector<FrameIndex>& cuts = file.meta.cuts;
  if (cuts.empty()) return "";
  return fmt::format(
      "the clip is cut at {}, and no track continues across a cut; to use only the part after it, "
      "give {}",
      CutsText(cuts),
      FramesOption(file, cuts.front()));
}

SequenceTracker TrackerOf(const TrackClipOptions& options, Sequence& sequence) {
  return {sequence,
          {.tracker = options.tracker,
           .second_pass = options.second_pass,
           .source = options.input.input}};
}

// To --json, if it is given.
void WriteFigures(const TrackFigures& figures, const TrackClipOptions& options) {
  if (options.json.empty()) return;
  WriteJsonFile(options.json,
                {{"frames", figures.frames},
                 {"repeats", figures.repeats},
                 {"tracks", figures.tracks},
                 {"observations", figures.observations},
                 {"predicted", figures.predicted},
                 {"mean_track_length", figures.mean_observed_length},
                 {"cuts", NumbersOf(figures.cuts)},
                 {"ms_per_frame",
                  {{"decode", figures.PerFrame(figures.decode_ms)},
                   {"detect", figures.PerFrame(figures.detect_ms)},
                   {"track", figures.PerFrame(figures.track_ms)},
                   {"write", figures.PerFrame(figures.write_ms)},
                   {"second_pass", figures.PerFrame(figures.second_pass_ms)}}},
                 {"options", ToJson(options)}});
}

}  // namespace

std::string WarningOfKept(const TrackFile& tracks) {
  if (tracks.meta.warning.empty()) return "";
  return fmt::format("{}; without --resume it is created again", tracks.meta.warning);
}

TrackFile RunSecondPass(TrackFile file,
                        Sequence& sequence,
                        const SecondPassOptions& options,
                        const JobReport& report) {
  SecondPass second = WithSecondPass(std::move(file), sequence, options, report.progress);
  if (second.none_because.empty()) {
    report.Tell(fmt::format("second pass: {}", second.figures.Brief()));
  } else {
    report.Warn(fmt::format("no second pass: {}", second.none_because));
  }
  return std::move(second.file);
}

TrackFigures TrackClip(const TrackClipOptions& options, const JobReport& report) {
  cv::setNumThreads(options.threads == 0 ? -1 : options.threads);
  CheckDistinctOutputs({{"--out", options.out}, {"--json", options.json}});
  const auto sequence = OpenToTrack(options.input, options.masks);
  CheckOutputsGiven({options.out, options.json});
  SequenceTracker tracker = TrackerOf(options, *sequence);
  TrackFile header = HeaderOf(options, *sequence, tracker);
  report.Warn(DoubtOfCamera(header.camera));
  report.Tell(DescribeFocalGuess(header));
  report.Warn(DescribeIdleOptions(options.tracker));

  TrackFigures figures;
  TrackFile file = tracker.TrackAll(std::move(header), report.progress);
  figures.cuts = file.meta.cuts;
  report.Tell(DescribeRepeats(file));
  report.Warn(DescribeCuts(file));
  figures.decode_ms = tracker.decode_ms();
  figures.detect_ms = tracker.detect_ms();
  figures.track_ms = tracker.track_ms();
  file.meta.warning = WarningOfClip(*sequence, file, options.input.input);
  report.Warn(file.meta.warning);
  if (sequence->CoverTooMuch()) {
    report.Warn(sequence->Coverage());
  } else {
    report.Tell(sequence->Coverage());
  }
  report.Tell(sequence->FixedPartsFound());
  NoteFixedParts(options.masks, *sequence, file);
  if (WantsSecondPass(options.second_pass.mode, options.tracker)) {
    const Stopwatch stopwatch;
    file = RunSecondPass(std::move(file), *sequence, options.second_pass, report);
    figures.second_pass_ms = stopwatch.Milliseconds();
  }
  const Stopwatch stopwatch;
  WriteTrackFile(options.out, file);
  figures.write_ms = stopwatch.Milliseconds();
  CountTracks(file, figures);
  WriteFigures(figures, options);
  return figures;
}

bool HasTracksOf(const TrackClipOptions& options, const JobReport& report) {
  if (!fs::exists(options.out)) return false;
  const TrackFile file = ReadTrackFile(options.out);
  const auto sequence = OpenInput(options.input, options.masks);
  const SequenceTracker tracker = TrackerOf(options, *sequence);
  if (!AgreesWith(file, HeaderOf(options, *sequence, tracker))) {
    ThrowError(
        "cannot resume {}: it was made from another input or with other options; without --resume "
        "it is created again",
        options.out);
  }
  report.Warn(WarningOfKept(file));
  return true;
}

}  // namespace cohort
