#pragma once

#include <vector>

#include "backend/scene/adjustment.h"
#include "backend/scene/reconstruction.h"

namespace cohort {

// The observations as a global shutter would have seen them: with the model's point X of each
// (where it has none, the one on its ray at the median depth of the frame), the pose T of its frame
// and T_y of the row that it was seen in (RowPoses),
//   xy + projection of T X - projection of T_y X.
// By `observed`'s positions, in the order of its observations; of frames without a pose as they are.
std::vector<Eigen::Vector2d> AsGlobalShutter(const WhitenedTracks& observed,
                                             const WorkingModel& model,
                                             double readout);

// The same of all tracks of a file, with a model's readout; predicted positions too.
TrackFile AsGlobalShutter(TrackFile file, const Reconstruction& model);

struct ReadoutEstimate {
  double readout = 0.0;  // share of the time between frames, first row to last; < 0: bottom up
  double sigma = 0.0;    // standard deviation; infinite: the tracks do not say

  // More than its errors, and than what matters.
  bool IsRolling() const;
};

// Finds the readout that leaves the least of the model's residuals, by bundle adjustments in which
// it is one unknown more: the observations, corrected for the readout so far, move linearly with
// what it is to change by, at the motion that the model had before (which the next round takes
// anew). Its deviation follows from the cost without it, which is (readout / sigma)^2 / 2 more, in
// units of the noise. `model` is of `observed`, and comes back adjusted to the readout found if it
// IsRolling, else as it was. Its tracks are then `corrected`, which must live as long as the model.
ReadoutEstimate EstimateReadout(const WhitenedTracks& observed,
                                WorkingModel& model,
                                WhitenedTracks& corrected);

// An estimate's readout, refined from there: of a model whose camera has been refined since. The
// model comes back adjusted to what was found; where that is no rolling shutter any more, or one
// the other way round, it does not count, and the estimate's readout stays.
double RefineReadout(const WhitenedTracks& observed,
                     const ReadoutEstimate& estimate,
                     WorkingModel& model,
                     WhitenedTracks& corrected);

// Adjusts the model to observations corrected for a readout, which depend on its motion: four times.
void AdjustToReadout(const WhitenedTracks& observed,
                     double readout,
                     WorkingModel& model,
                     WhitenedTracks& corrected);

}  // namespace cohort
