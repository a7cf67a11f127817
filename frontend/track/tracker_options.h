#pragma once

#include "frontend/core/options.h"
#include "frontend/track/baselines/klt_tracker.h"
#include "frontend/track/baselines/rlof_tracker.h"
#include "frontend/track/loop/track_loop.h"
#include "frontend/track/subspace/subspace_tracker.h"

namespace cohort {

enum class TrackerKind { kSubspace, kDescent, kKlt, kAnchoredKlt, kRlof };
inline constexpr ChoiceNames<TrackerKind, 5> kTrackerNames{
    {{"subspace", TrackerKind::kSubspace},
     {"descent", TrackerKind::kDescent},
     {"klt", TrackerKind::kKlt},
     {"anchored-klt", TrackerKind::kAnchoredKlt},
     {"rlof", TrackerKind::kRlof}}};

struct TrackerOptions : TrackLoopOptions {
  TrackerKind tracker = TrackerKind::kSubspace;
  KltOptions klt;
  AnchoredKltOptions anchored_klt;
  RlofOptions rlof;
  SubspaceOptions subspace;
  MeasurementOptions measurement;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Choice("tracker",
             o.tracker,
             kTrackerNames,
             "The tracker: subspace tracks all features jointly, the others track each feature "
             "independently. klt is what most programs use; subspace takes longer and loses fewer "
             "features in the dark.",
             Tier::kCommon);
    TrackLoopOptions::Visit(o, v);
    v.Group("klt", o.klt, "tracker klt");
    v.Group("anchored_klt", o.anchored_klt, "tracker anchored-klt");
    v.Group("rlof", o.rlof, "tracker rlof");
    v.Group("subspace", o.subspace, "tracker subspace");
    v.Group("measurement", o.measurement, "measurement after the guide, tracker subspace");
  }
};

}  // namespace cohort
