#include "frontend/track/steady_light_tracker.h"

namespace cohort {

FrameResult SteadyLightTracker::Track(const Frame& frame) {
  Frame steady = frame;
  steady.float_step = IntensityStep(frame.gray);
  steady.gray = WithoutLight(frame.gray, exposure_.Follow(frame.gray));
  return tracker_->Track(steady);
}

}  // namespace cohort
