#pragma once

#include <opencv2/core/mat.hpp>
#include <span>
#include <string>
#include <vector>

#include "backend/scene/reconstruction.h"
#include "datasets/readers/sequence.h"
#include "frontend/track/second_pass/second_pass_measurer.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/sfm/progress.h"

namespace cohort {

enum class SecondPassMode { kAuto, kOn, kOff };
inline constexpr ChoiceNames<SecondPassMode, 3> kSecondPassModeNames{
    {{"auto", SecondPassMode::kAuto}, {"on", SecondPassMode::kOn}, {"off", SecondPassMode::kOff}}};

struct SecondPassOptions {
  SecondPassMode mode = SecondPassMode::kAuto;
  double min_confirmed = 0.5;
  SecondPassMeasurementOptions measurement;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Choice(
        "mode",
        o.mode,
        kSecondPassModeNames,
        "After the last frame, reconstruct, and measure every feature again where the model "
        "predicts it. The tracks become more accurate, at the price of reading the video again; "
        "auto does it for the tracker subspace with the strong constraint and measurement.",
        Tier::kCommon);
    VisitMeasurement(o, v);
  }

  // All options except those that choose the first pass, for callers that have tracks already.
  template <typename Self, typename Visitor>
  static void VisitMeasurement(Self& o, Visitor& v) {
    v.Number("min_confirmed",
             o.min_confirmed,
             0.0,
             1.0,
             "The share of a feature's observations that must be found again where the model "
             "predicts them; otherwise the feature keeps its track of the first pass.",
             Tier::kCommon);
    SecondPassMeasurementOptions::Visit(o.measurement, v);
  }
};

// After several rounds (WithSecondPass): the figures of the last one.
struct SecondPassFigures {
  std::size_t before = 0;    // observations of the tracks that are replaced
  std::size_t kept = 0;      // of these, measured again
  std::size_t regained = 0;  // new observations
  std::size_t replaced = 0;  // tracks
  std::size_t left = 0;      // tracks that have a point, but were not found again
  std::size_t masked = 0;    // tracks entirely in the mask: dropped

  double Confirmed() const;  // kept, as a share
  void Add(const SecondPassFigures& other);
  std::string Brief() const;
};

struct SecondPass {
  TrackFile file;
  SecondPassFigures figures;
  std::string none_because;  // of WithSecondPass: why `file` is the first pass's; else empty
};

// TrackMeta::second_pass_options: all but mode, so that tracks made with `auto` match a run with
// `on`.
std::string SecondPassOptionsText(const SecondPassOptions& options);

// Measures tracks again where the model's points are seen (SecondPassMeasurer). If a feature is not
// found in a frame between its sightings, or in one where the first pass had it, the model predicts
// it. Tracks without a point or with too few measurements, and frames without a pose, stay
// unchanged. `sequence`: the clip, rewound here; nothing is measured where a frame's mask is black.
// Throws Error if clip, model and tracks do not belong together.
SecondPass MeasureAgain(const TrackFile& file,
                        const Reconstruction& model,
                        Sequence& sequence,
                        const SecondPassOptions& options,
                        const StageProgress& progress = {});

// Whether a later model has many points at other positions in the pictures than the first of
// `models`, so far off that features were searched for in the wrong places, or has frames that none
// of them had, or nothing in common.
bool HaveMoved(std::span<const Reconstruction> models,
               const Reconstruction& now,
               const SecondPassOptions& options);

// Runs the second pass with its own model by Ceres, or one for each part of a broken clip. If there
// is no model, returns `file` itself, with the reason in meta.no_second_pass.
SecondPass WithSecondPass(TrackFile file,
                          Sequence& sequence,
                          const SecondPassOptions& options,
                          const StageProgress& progress = {});

}  // namespace cohort
