#pragma once

#include <memory>

#include "frontend/track/track_loop.h"

namespace cohort {

// The baseline: pyramidal Lucas-Kanade from frame to frame (cv::calcOpticalFlowPyrLK), each feature
// for itself, checked by tracking back: a feature that does not return to within
// forward_backward_px of where it came from ends.
std::unique_ptr<FeatureMover> MakeKltMover(const KltOptions& options);

// The same as a guide, and then Lucas-Kanade once more from the guided position against the
// feature's own first frame, so that errors do not add up: a translation, on few levels. The result
// is observed where it is near the guide and tracks back to where the feature began, else the
// feature stays predicted at the guide; it ends after some such frames in a row. It has what
// anchoring is worth by itself, without any constraint between features.
std::unique_ptr<FeatureMover> MakeAnchoredKltMover(const AnchoredKltOptions& options);

}  // namespace cohort
