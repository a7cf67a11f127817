#include "pipelines/sfm/track_sequence.h"

#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "frontend/core/stopwatch.h"
#include "pipelines/json/option_list.h"
#include "pipelines/sfm/cuts.h"
#include "pipelines/sfm/input.h"
#include "pipelines/sfm/repeated_frames.h"

namespace cohort {

bool WantsSecondPass(SecondPassMode mode, const TrackerOptions& tracker) {
  switch (mode) {
    case SecondPassMode::kAuto:
      return tracker.tracker == TrackerKind::kSubspace &&
             tracker.subspace.constraint == Constraint::kStrong && tracker.measurement.enabled;
    case SecondPassMode::kOn:
      return true;
    case SecondPassMode::kOff:
      return false;
  }
  return false;
}

SequenceTracker::SequenceTracker(Sequence& sequence, const TrackSequenceOptions& options)
    : sequence_(sequence),
      promised_(sequence.FrameCount()),
      frames_(sequence),
      tracker_(MakeTracker(options.tracker)) {
  next_ = frames_.Next();
  if (!next_) {
    const std::string name = options.source.empty() ? sequence.Name() : options.source.string();
    ThrowError("{}: no frame to track. {}", name, sequence.Warning());
  }
  header_.source = AbsolutePath(options.source);
  header_.image_root = AbsolutePath(sequence.ImageRoot());
  header_.width_px = next_->gray.cols;
  header_.height_px = next_->gray.rows;
  if (options.camera) CheckCameraSize(*options.camera, header_.width_px, header_.height_px);
  header_.meta.tracker = NameOf(kTrackerNames, options.tracker.tracker);
  header_.meta.options = ToJson(options.tracker).dump();
  if (options.camera) {
    NoteCamera(options.camera, header_);
  } else {
    NoteCamera(sequence, header_);
  }
  if (WantsSecondPass(options.second_pass.mode, options.tracker)) {
    header_.meta.second_pass_options = SecondPassOptionsText(options.second_pass);
  }
  NoteSensorRows(sequence, header_);
}

void SequenceTracker::LookForRepeats(const StageProgress& progress) {
  if (std::exchange(looked_, true) || !sequence_.CanRewind()) return;
  const Stopwatch stopwatch;
  std::vector<FrameInfo> infos;
  std::vector<FrameChange> changes;
  cv::Mat before;
  if (progress) progress("look", 0, promised_);
  for (std::optional<Frame> frame = std::exchange(next_, std::nullopt); frame;
       frame = frames_.Next()) {
    frames_.Begin();
    infos.push_back(InfoOf(*frame));
    if (!before.empty()) changes.push_back(ChangeBetween(before, frame->gray));
    before = frame->gray;
    if (progress) progress("look", infos.size(), promised_);
  }
  const std::vector<std::size_t> repeats = FindRepeats(changes);
  auto repeat = repeats.begin();
  FrameIndex original{};
  for (std::size_t i = 0; i < infos.size(); ++i) {
    if (repeat == repeats.end() || *repeat != i) {
      original = infos[i].index;
      continue;
    }
    repeats_.push_back({infos[i], original});
    ++repeat;
  }
  if (promised_) promised_ = infos.size() - repeats_.size();
  sequence_.Rewind();
  decode_ms_ += stopwatch.Milliseconds();
}

bool SequenceTracker::HasNext() {
  LookForRepeats();
  while (!next_ && !ended_) {
    const Stopwatch stopwatch;
    next_ = frames_.Next();
    ended_ = !next_.has_value();
    decode_ms_ += stopwatch.Milliseconds();
    if (ended_ || repeats_passed_ == repeats_.size() ||
        next_->index != repeats_[repeats_passed_].frame.index) {
      continue;
    }
    ++repeats_passed_;
    next_.reset();
  }
  return !ended_;
}

TrackedFrame SequenceTracker::TrackNext() {
  Check(HasNext(), "there is a frame to track");
  frames_.Begin();
  const Stopwatch stopwatch;
  TrackedFrame frame{InfoOf(*next_), tracker_->Track(*next_)};
  detect_ms_ += frame.result.detect_ms;
  track_ms_ += stopwatch.Milliseconds() - frame.result.detect_ms;
  next_.reset();
  return frame;
}

TrackFile SequenceTracker::TrackAll(TrackFile header, const StageProgress& progress) {
  TrackFile file = std::move(header);
  std::vector<Observation> observations;
  std::vector<TrackEnd> ends;
  LookForRepeats(progress);
  file.repeats = repeats_;
  if (progress) progress("track", 0, promised_);
  while (HasNext()) {
    TrackedFrame frame = TrackNext();
    if (frame.result.cut) file.meta.cuts.push_back(frame.info.index);
    file.frames.push_back(std::move(frame.info));
    observations.insert(
        observations.end(), frame.result.observations.begin(), frame.result.observations.end());
    ends.insert(ends.end(), frame.result.ends.begin(), frame.result.ends.end());
    if (progress) progress("track", file.frames.size(), promised_);
  }
  const std::size_t count = file.frames.size();
  if (progress && promised_ != count) progress("track", count, count);
  file.tracks = TrackSet::Build(std::move(observations), std::move(ends));
  return file;
}

TrackFile TrackFirstPass(Sequence& sequence,
                         const TrackSequenceOptions& options,
                         const StageProgress& progress) {
  SequenceTracker tracker(sequence, options);
  return tracker.TrackAll(tracker.Header(), progress);
}

TrackFile TrackSequence(Sequence& sequence,
                        const TrackSequenceOptions& options,
                        const StageProgress& progress) {
  TrackFile file = TrackFirstPass(sequence, options, progress);
  if (!WantsSecondPass(options.second_pass.mode, options.tracker)) return file;
  return WithSecondPass(std::move(file), sequence, options.second_pass, progress).file;
}

}  // namespace cohort
