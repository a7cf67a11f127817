#pragma once

#include <string>

#include "frontend/track/tracker_options.h"
#include "pipelines/sfm/reconstruct.h"

namespace cohort {

// A sentence that names the options with other values than the defaults that the tracker, or the
// backend, does not use; empty if there are none. It is not an error, because one file of options
// may serve several.
std::string DescribeIdleOptions(const TrackerOptions& options);
std::string DescribeIdleOptions(const ReconstructOptions& options);

}  // namespace cohort
