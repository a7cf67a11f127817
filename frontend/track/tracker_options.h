#pragma once

#include "frontend/core/options.h"
#include "frontend/detect/corners.h"
#include "frontend/track/baselines/klt_tracker.h"
#include "frontend/track/baselines/rlof_tracker.h"
#include "frontend/track/subspace/subspace_tracker.h"

namespace cohort {

enum class TrackerKind { kSubspace, kDescent, kKlt, kAnchoredKlt, kRlof };
inline constexpr ChoiceNames<TrackerKind, 5> kTrackerNames{
    {{"subspace", TrackerKind::kSubspace},
     {"descent", TrackerKind::kDescent},
     {"klt", TrackerKind::kKlt},
     {"anchored-klt", TrackerKind::kAnchoredKlt},
     {"rlof", TrackerKind::kRlof}}};

struct TrackerOptions {
  TrackerKind tracker = TrackerKind::kSubspace;
  int max_unconfirmed_frames = 20;
  bool cuts = true;
  DetectorOptions detector;
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
    v.Number("max_unconfirmed_frames",
             o.max_unconfirmed_frames,
             0,
             100000,
             "a feature ends after more than this many frames in a row in which the image does not "
             "confirm it");
    v.Flag("cuts",
           o.cuts,
           "End all tracks at cuts of the clip, and keep them through frames that show nothing. "
           "Otherwise features that look alike by chance on both sides of a cut are tracked across "
           "it.",
           Tier::kCommon);
    v.Group("detector", o.detector, "corner detection");
    v.Group("klt", o.klt, "tracker klt");
    v.Group("anchored_klt", o.anchored_klt, "tracker anchored-klt");
    v.Group("rlof", o.rlof, "tracker rlof");
    v.Group("subspace", o.subspace, "tracker subspace");
    v.Group("measurement", o.measurement, "measurement after the guide, tracker subspace");
  }
};

}  // namespace cohort
