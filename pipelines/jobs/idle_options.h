#pragma once

#include "backend/scene/mapper.h"
#include "frontend/track/tracker_options.h"
#include "pipelines/sfm/reconstruct.h"

namespace cohort {

// A warning in the log that names the options that are not as they are by default though the
// tracker, or the backend with this camera, does not read them. No error: one file of options may
// be meant for several.
void WarnOfIdleOptions(const TrackerOptions& options);
void WarnOfIdleOptions(const ReconstructOptions& options);

}  // namespace cohort
