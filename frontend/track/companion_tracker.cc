#include "frontend/track/companion_tracker.h"

namespace cohort {

FrameResult CompanionTracker::Track(const Frame& frame) {
  const auto as_companion = [](FeatureId& id) {
    id = FeatureId{ToInt(id) + ToInt(kFirstCompanion)};
  };
  FrameResult result = tracker_->Track(frame);
  const FrameResult beside = companion_->Track(frame);
  result.detect_ms += beside.detect_ms;
  for (Observation o : beside.observations) {
    as_companion(o.feature);
    result.observations.push_back(o);
  }
  for (TrackEnd end : beside.ends) {
    as_companion(end.feature);
    result.ends.push_back(end);
  }
  return result;
}

}  // namespace cohort
