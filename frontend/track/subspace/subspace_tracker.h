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

// The paper's tracker: all features move together, from frame to frame, to the minimum of the total
// energy (joint_guide.h), with the trajectories of the last L frames as history. Each position is
// then measured (frame_measurement.h). A position that the image confirms is observed. Otherwise
// the feature is predicted from its own past and the other features until it is seen again or is
// lost (predicted_or_ended.h). The history holds the most probable positions. docs/how_it_works.md
// lists the steps. guide_mover.h is the tracker without measuring.
std::unique_ptr<FeatureMover> MakeSubspaceMover(const SubspaceOptions& options,
                                                const MeasurementOptions& measurement);

}  // namespace cohort
