#pragma once

#include <opencv2/core/mat.hpp>

#include "frontend/image/pyramid.h"

namespace cohort {

enum class SceneChange {
  kNone,   // the scene continues, or the pictures do not decide
  kBlank,  // nothing is seen compared with the last picture: a lost frame, a flash, a hand
  kCut,    // the picture has nothing in common with the earlier ones
};

// Distinguishes a cut from everything that resembles one. Pictures are compared at a small size
// (about 4,800 pixels, which averages the noise of the dark away) and without their coarsest shades
// (light, vignettes), in two ways:
//   match   correlation over the whole picture, shifted by phase correlation;
//   flow    the share of blocks of 10 x 10 whose best match, anywhere in the other picture, lies as
//           a neighbouring block's does. A camera too fast for one shift still has flow; chance
//           matches do not.
// A cut has neither (match below half of the previous frame's, flow < 0.22) and follows two frames
// that matched (>= 0.5). In the dark, or where a camera turns too fast, frames of one scene do not
// match either, and no cut is reported. Correlation is invariant to exposure, and blur keeps coarse
// structure.
class SceneWatch {
 public:
  // Compares the clip's next picture with the last one that was not blank.
  SceneChange Follow(const Pyramid& picture);

 private:
  cv::Mat last_;        // small, CV_32F; empty at first
  double match_ = 0.0;  // of the last two
  cv::Mat blank_;       // the last blank one since `last_`
};

}  // namespace cohort
