#pragma once

#include <memory>

#include "frontend/track/track_loop.h"

namespace cohort {

// A baseline: robust local optical flow (cv::optflow::calcOpticalFlowSparseRLOF; Senst, Eiselein,
// Sikora 2012-2016): Lucas-Kanade with a redescending norm, an illumination model and the whole
// picture's motion as its start. Checked by tracking back, as klt.
std::unique_ptr<FeatureMover> MakeRlofMover(const RlofOptions& options);

}  // namespace cohort
