#pragma once

#include <vector>

#include "backend/adjust/adjustment.h"
#include "backend/scene/reconstruction.h"

namespace cohort {

// The observations as a global shutter would have seen them. With the model's point X of each (if
// there is none, the point on its ray at the median depth of the frame), the pose T of its frame
// and the pose T_y of its row (RowPoses), the position is
//   xy + projection of T X - projection of T_y X.
// Uses the positions of `observed`, in the order of its observations; frames without a pose are
// unchanged.
std::vector<Eigen::Vector2d> AsGlobalShutter(const WhitenedTracks& observed,
                                             const WorkingModel& model,
                                             double readout);

// The same for all tracks of a file, with a model's readout; includes predicted positions.
TrackFile AsGlobalShutter(TrackFile file, const Reconstruction& model);

struct ReadoutEstimate {
  double readout = 0.0;  // share of the time between frames, first row to last; < 0: bottom up
  double sigma = 0.0;    // standard deviation; infinite if the tracks do not determine it

  // Whether it exceeds its own error and the smallest readout that matters.
  bool IsRolling() const;
};

// Finds the readout that minimises the model's residuals, by bundle adjustments with it as one more
// unknown. The observations, corrected for the current readout, move linearly with its change, at
// the motion of the model (which the next round updates). The standard deviation follows from the
// cost without a readout, which is higher by (readout / sigma)^2 / 2 in units of the noise. `model`
// is of `observed`, and is adjusted to the readout found if it IsRolling, else left as it was. Its
// tracks are then `corrected`, which must outlive the model.
ReadoutEstimate EstimateReadout(const WhitenedTracks& observed,
                                WorkingModel& model,
                                WhitenedTracks& corrected);

// Refines an estimate's readout for a model whose camera has been refined since. The model is
// adjusted to the result. If the result is no longer a rolling shutter, or has the opposite
// direction, the function returns the estimate's readout instead.
double RefineReadout(const WhitenedTracks& observed,
                     const ReadoutEstimate& estimate,
                     WorkingModel& model,
                     WhitenedTracks& corrected);

// Adjusts the model to observations corrected for a readout. The correction depends on the model's
// motion, so this is repeated four times.
void AdjustToReadout(const WhitenedTracks& observed,
                     double readout,
                     WorkingModel& model,
                     WhitenedTracks& corrected);

}  // namespace cohort
