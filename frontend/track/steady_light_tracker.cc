#include "frontend/track/steady_light_tracker.h"

namespace cohort {

FrameResult SteadyLightTracker::Track(const Frame& frame) {
  return tracker_->Track(WithoutLight(frame, exposure_.Follow(frame.gray)));
}

}  // namespace cohort
