#pragma once

#include <memory>

#include "frontend/core/options.h"
#include "frontend/track/loop/feature_mover.h"
#include "frontend/track/measure/measurement.h"
#include "frontend/track/subspace/joint_guide.h"

namespace cohort {

// Guide, then measure: one unconstrained alignment of a larger patch with the feature's anchor
// starts at the guided position. A feature that the image does not confirm stays predicted.
struct MeasurementOptions {
  bool enabled = true;
  PatchOptions patch;
  int max_rank = 8;
  bool perspective = true;
  int max_unexplained_frames = 4;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Flag("enabled", o.enabled, "measure every guided position against the feature's anchor");
    PatchOptions::Visit(o.patch, v);
    v.Number("max_rank",
             o.max_rank,
             2,
             8,
             "maximum rank of the trajectory model, which starts at 2 and grows where the "
             "residuals require it; 3: one rigid body");
    v.Flag("perspective",
           o.perspective,
           "the trajectory model has projective cameras; off: affine ones");
    v.Number("max_unexplained_frames",
             o.max_unexplained_frames,
             0,
             100000,
             "a feature ends after more than this many frames in a row in which it is not "
             "confirmed although nothing hides it, or if it changes slowly; 0: no check");
  }
};

// The joint tracker. In every frame (docs/how_it_works.md, "One frame"):
//   1. A guide finds where each feature probably is (guide.h). By default that is Lucas-Kanade on
//      the coarse levels, each feature alone.
//   2. A patch is aligned with the feature's anchor from there, and tested (frame_measurement.h).
//   3. The constraint is the trajectory model of all features (trajectory_model.h): a measurement
//      that contradicts it does not count, and what is not seen is measured again where the model
//      predicts it.
//   4. A feature that is still not seen is predicted or ends (predicted_or_ended.h).
// The tracker of the paper is the guide of --penalty, which moves all features together to the
// minimum of the total energy, equation (3): joint_guide.h; its penalty, equations (4) to (6):
// frontend/energy/penalty.h. Without measuring it is the tracker as published (guide_mover.h).
std::unique_ptr<FeatureMover> MakeSubspaceMover(const SubspaceOptions& options,
                                                const MeasurementOptions& measurement);

}  // namespace cohort
