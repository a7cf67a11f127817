#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "datasets/readers/sequence.h"
#include "frontend/track/tracker.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/sfm/progress.h"
#include "pipelines/sfm/read_ahead.h"
#include "pipelines/sfm/second_pass.h"

namespace cohort {

struct TrackSequenceOptions {
  TrackerOptions tracker = {};
  SecondPassOptions second_pass = {};
  // For pictures of the clip's size; unset: the sequence's (NoteCamera), else unknown.
  std::optional<Camera> camera = {};
  // The path that the sequence was opened from. If COLMAP needs a video's frames, they are read
  // from there again.
  std::filesystem::path source = {};
};

// Tracks a clip: the whole job of `cohort track` in memory. With a second pass (WantsSecondPass),
// its tracks replace those of the first if a reconstruction by Ceres succeeds; meta states the
// outcome. Throws Error on a clip without frames or with a camera for other pictures.
//
//   const auto clip = OpenSequence("night.mp4");
//   const TrackFile file = TrackSequence(*clip, {.source = "night.mp4"});
//   WriteTrackFile("night.tracks", file);
TrackFile TrackSequence(Sequence& sequence,
                        const TrackSequenceOptions& options = {},
                        const StageProgress& progress = {});

// The first pass alone; WithSecondPass runs the second.
TrackFile TrackFirstPass(Sequence& sequence,
                         const TrackSequenceOptions& options = {},
                         const StageProgress& progress = {});

// One frame's tracks.
struct TrackedFrame {
  FrameInfo info;
  FrameResult result;
};

// The first pass frame by frame, for callers that need each frame's tracks at once.
//
//   SequenceTracker tracker(*clip, {.source = "night.mp4"});
//   while (tracker.HasNext()) {                       // but the frames that repeat another
//     const TrackedFrame frame = tracker.TrackNext();
//     Show(frame.info, frame.result.observations);
//   }
//
// If frames do not come from a Sequence, use MakeTracker (frontend/track/tracker.h).
class SequenceTracker {
 public:
  // Reads the first frame; throws Error without one. `sequence` must outlive this.
  SequenceTracker(Sequence& sequence, const TrackSequenceOptions& options);

  // Everything in the file but frames and tracks, and where the clip is cut. meta: the
  // tracker's name, its options as JSON, and those of a second pass that is to come.
  const TrackFile& Header() const { return header_; }
  // Reads the whole clip for frames that repeat the one before (FindRepeats), which are left out;
  // the first HasNext does it without progress.
  void LookForRepeats(const StageProgress& progress = {});
  bool HasNext();  // reads the next frame, if not done yet
  TrackedFrame TrackNext();
  // The header with all frames from the next on, their tracks, the repeats and the cuts.
  TrackFile TrackAll(TrackFile header, const StageProgress& progress = {});

  // Time so far over all frames.
  double decode_ms() const { return decode_ms_; }
  double detect_ms() const { return detect_ms_; }
  double track_ms() const { return track_ms_; }  // without detection

 private:
  Sequence& sequence_;
  std::optional<std::size_t> promised_;  // asked before another thread reads ahead
  ReadAhead frames_;
  std::optional<Frame> next_;  // unset: not read yet, or the end
  bool ended_ = false;
  bool looked_ = false;  // for repeats
  std::vector<RepeatedFrame> repeats_;
  std::size_t repeats_passed_ = 0;
  TrackFile header_;
  std::unique_ptr<TrackLoop> tracker_;
  double decode_ms_ = 0.0;
  double detect_ms_ = 0.0;
  double track_ms_ = 0.0;
};

// Whether there will be a second pass. Mode auto: for the tracker subspace with the strong
// constraint and measurement.
bool WantsSecondPass(SecondPassMode mode, const TrackerOptions& tracker);

}  // namespace cohort
