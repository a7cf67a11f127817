#pragma once

#include <memory>

#include "frontend/track/track_loop.h"

namespace cohort {

// The baseline: pyramidal Lucas-Kanade from frame to frame (cv::calcOpticalFlowPyrLK), each feature
// for itself, checked by tracking back: a feature that does not return to within
// forward_backward_px of where it came from ends.
std::unique_ptr<FeatureMover> MakeKltMover(const KltOptions& options);

}  // namespace cohort
