#pragma once

#include "backend/mapper/mapper.h"
#include "frontend/track/tracker_options.h"
#include "pipelines/sfm/reconstruct.h"

namespace cohort {

// Logs a warning that names the options with other values than the defaults that the tracker, or
// the backend with this camera, does not use. It is not an error, because one file of options may
// serve several.
void WarnOfIdleOptions(const TrackerOptions& options);
void WarnOfIdleOptions(const ReconstructOptions& options);

}  // namespace cohort
