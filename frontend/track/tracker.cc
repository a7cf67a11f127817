#include "frontend/track/tracker.h"

#include "frontend/track/baselines/dense_flow_tracker.h"
#include "frontend/track/baselines/klt_tracker.h"
#include "frontend/track/baselines/rlof_tracker.h"
#include "frontend/track/subspace/guide_mover.h"
#include "frontend/track/subspace/subspace_tracker.h"
#include "frontend/track/track_loop.h"

namespace cohort {

std::unique_ptr<FeatureMover> MakeMover(const TrackerOptions& options) {
  switch (options.tracker) {
    case TrackerKind::kKlt:
      return MakeKltMover(options.klt);
    case TrackerKind::kAnchoredKlt:
      return MakeAnchoredKltMover(options.anchored_klt);
    case TrackerKind::kRlof:
      return MakeRlofMover(options.rlof);
    case TrackerKind::kDis:
      return MakeDenseFlowMover(DenseFlowMethod::kDis, options.dense_flow);
    case TrackerKind::kDeepFlow:
      return MakeDenseFlowMover(DenseFlowMethod::kDeepFlow, options.dense_flow);
    case TrackerKind::kSubspace:
      return MakeSubspaceMover(options.subspace, options.measurement);
    case TrackerKind::kDescent: {
      SubspaceOptions alone = options.subspace;
      alone.penalty_weight = 0.0;
      return MakeGuideMover(alone, options.measurement.patch);
    }
  }
  ThrowUsageError("unknown tracker");
}

std::set<std::string> OptionGroupsOf(TrackerKind kind) {
  switch (kind) {
    case TrackerKind::kSubspace:
    case TrackerKind::kDescent:
      return {"subspace", "measurement"};
    case TrackerKind::kKlt:
      return {"klt"};
    case TrackerKind::kAnchoredKlt:
      return {"anchored_klt"};
    case TrackerKind::kRlof:
      return {"rlof"};
    case TrackerKind::kDis:
    case TrackerKind::kDeepFlow:
      return {"dense_flow"};
  }
  ThrowUsageError("unknown tracker");
}

std::unique_ptr<Tracker> MakeTracker(const TrackerOptions& options, const cv::Mat& mask) {
  ValidateOptions(options);
  return std::make_unique<TrackLoop>(options, mask, MakeMover(options));
}

}  // namespace cohort
