#pragma once

#include <memory>
#include <set>
#include <string>
#include <vector>

#include "frontend/image/frame.h"
#include "frontend/track/tracker_options.h"
#include "frontend/tracks/observation.h"
#include "frontend/tracks/track_set.h"

namespace cohort {

// The result of a tracker for one frame.
struct FrameResult {
  std::vector<Observation> observations;  // ascending features; of this frame
  std::vector<TrackEnd> ends;             // tracks that ended before this frame, ascending features
  bool cut = false;        // this frame is the first of another scene: all tracks ended before it
  double detect_ms = 0.0;  // time spent on finding corners; for reports
  // A tracker is causal: it never corrects states or positions of earlier frames.
};

// Tracks features from frame to frame. Synchronous and causal, without threads or queues.
//
//   auto tracker = MakeTracker(options);
//   while (auto frame = sequence->Next()) Use(tracker->Track(*frame));
class Tracker {
 public:
  virtual ~Tracker() = default;
  virtual FrameResult Track(const Frame& frame) = 0;
};

// The groups of TrackerOptions that this tracker reads, beside the detector's.
std::set<std::string> OptionGroupsOf(TrackerKind kind);

// Features are neither born nor stay where a frame's mask is 0. Throws UsageError if an option is
// out of range.
std::unique_ptr<Tracker> MakeTracker(const TrackerOptions& options);

}  // namespace cohort
