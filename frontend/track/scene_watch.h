#pragma once

#include <opencv2/core/mat.hpp>

#include "frontend/image/pyramid.h"

namespace cohort {

enum class SceneChange {
  kNone,   // the scene goes on, or there is no telling
  kBlank,  // the picture shows nothing beside the last one: a frame lost, a flash, a hand before it
  kCut,    // what is seen has nothing in common with what was seen before
};

// Tells a cut from all that looks like one. Pictures are compared small (4,800 pixels or so, where
// the noise of the dark is averaged away) and without their coarsest shades (light, vignettes), in
// two ways:
//   match   correlation over the whole picture, shifted as phase correlation says;
//   flow    the share of blocks of 10 x 10 whose best match, anywhere in the other picture, lies as
//           a neighbouring block's does: what a camera too fast for one shift still has, and chance
//           has not.
// A cut has neither (match under half of what it was a frame before, flow < 0.22), and comes after
// two frames that matched (>= 0.5): in the dark, or where a camera turns too fast to be followed,
// frames of one scene do not match either, and nothing is said. Correlations do not know of
// exposure, and blur leaves what is coarse.
class SceneWatch {
 public:
  // The clip's next picture, against the last one that was not blank.
  SceneChange Follow(const Pyramid& picture);

 private:
  cv::Mat last_;        // small, CV_32F; empty at first
  double match_ = 0.0;  // of the last two
  cv::Mat blank_;       // the last blank one since `last_`
};

}  // namespace cohort
