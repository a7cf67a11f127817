#include "frontend/track/tracker.h"

#include <algorithm>

#include "frontend/track/baselines/klt_tracker.h"
#include "frontend/track/baselines/rlof_tracker.h"
#include "frontend/track/subspace/guide_mover.h"
#include "frontend/track/subspace/subspace_tracker.h"
#include "frontend/track/track_loop.h"

namespace cohort {

namespace {

// All trackers: the groups of options that each reads, beside the detector's, and what moves its
// features.
struct KindOfTracker {
  TrackerKind kind;
  std::set<std::string> groups;
  std::unique_ptr<FeatureMover> (*mover)(const TrackerOptions& options);
};

const KindOfTracker& Find(TrackerKind kind) {
  using Options = TrackerOptions;
  static const std::vector<KindOfTracker> kinds{
      {TrackerKind::kSubspace,
       {"subspace", "measurement"},
       [](const Options& o) { return MakeSubspaceMover(o.subspace, o.measurement); }},
      {TrackerKind::kDescent,
       {"subspace"},
       [](const Options& o) {
         SubspaceOptions alone = o.subspace;
         alone.penalty = PenaltyKind::kNone;
         return MakeGuideMover(alone);
       }},
      {TrackerKind::kKlt, {"klt"}, [](const Options& o) { return MakeKltMover(o.klt); }},
      {TrackerKind::kAnchoredKlt,
       {"anchored_klt"},
       [](const Options& o) { return MakeAnchoredKltMover(o.anchored_klt); }},
      {TrackerKind::kRlof, {"rlof"}, [](const Options& o) { return MakeRlofMover(o.rlof); }},
  };
  const auto found = std::ranges::find(kinds, kind, &KindOfTracker::kind);
  if (found == kinds.end()) ThrowUsageError("unknown tracker");
  return *found;
}

}  // namespace

std::unique_ptr<FeatureMover> MakeMover(const TrackerOptions& options) {
  return Find(options.tracker).mover(options);
}

std::set<std::string> OptionGroupsOf(TrackerKind kind) { return Find(kind).groups; }

std::unique_ptr<Tracker> MakeTracker(const TrackerOptions& options) {
  ValidateOptions(options);
  return std::make_unique<TrackLoop>(options, MakeMover(options));
}

}  // namespace cohort
