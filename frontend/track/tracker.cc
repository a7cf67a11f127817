#include "frontend/track/tracker.h"

#include <algorithm>
#include <vector>

#include "frontend/core/error.h"
#include "frontend/track/subspace/guide_mover.h"

namespace cohort {

namespace {

// All trackers: what each reads (OptionsReadBy), and what moves its features.
struct KindOfTracker {
  TrackerKind kind;
  std::set<std::string> reads;
  std::unique_ptr<FeatureMover> (*mover)(const TrackerOptions& options);
};

const KindOfTracker& Find(TrackerKind kind) {
  static const std::vector<KindOfTracker> kinds{
      {TrackerKind::kSubspace,
       {"subspace", "measurement"},
       [](const TrackerOptions& o) { return MakeSubspaceMover(o.subspace, o.measurement); }},
      {TrackerKind::kDescent,
       {"subspace.template_px", "subspace.min_iterations", "subspace.max_iterations"},
       [](const TrackerOptions& o) {
         SubspaceOptions alone = o.subspace;
         alone.penalty = PenaltyKind::kNone;
         return MakeGuideMover(alone);
       }},
      {TrackerKind::kKlt, {"klt"}, [](const TrackerOptions& o) { return MakeKltMover(o.klt); }},
      {TrackerKind::kAnchoredKlt,
       {"anchored_klt"},
       [](const TrackerOptions& o) { return MakeAnchoredKltMover(o.anchored_klt); }},
      {TrackerKind::kRlof, {"rlof"}, [](const TrackerOptions& o) { return MakeRlofMover(o.rlof); }},
  };
  const auto found = std::ranges::find(kinds, kind, &KindOfTracker::kind);
  if (found == kinds.end()) ThrowUsageError("unknown tracker");
  return *found;
}

}  // namespace

std::unique_ptr<FeatureMover> MakeMover(const TrackerOptions& options) {
  return Find(options.tracker).mover(options);
}

std::unique_ptr<TrackLoop> MakeTracker(const TrackerOptions& options) {
  ValidateOptions(options);
  return std::make_unique<TrackLoop>(options, MakeMover(options));
}

std::set<std::string> OptionsReadBy(const TrackerOptions& options) {
  // Lucas-Kanade takes the place of the joint guide.
  const bool is_alone = options.tracker == TrackerKind::kSubspace && options.measurement.enabled &&
                        options.subspace.penalty == PenaltyKind::kNone;
  if (is_alone) return {"subspace.constraint", "subspace.penalty", "measurement"};
  return Find(options.tracker).reads;
}

}  // namespace cohort
