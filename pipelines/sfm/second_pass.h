#pragma once

#include <opencv2/core/mat.hpp>
#include <span>
#include <string>
#include <vector>

#include "backend/scene/reconstruction.h"
#include "datasets/readers/sequence.h"
#include "frontend/track/second_pass_measurer.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/sfm/progress.h"

namespace cohort {

enum class SecondPassMode { kAuto, kOn, kOff };
inline constexpr ChoiceNames<SecondPassMode, 3> kSecondPassModeNames{
    {{"auto", SecondPassMode::kAuto}, {"on", SecondPassMode::kOn}, {"off", SecondPassMode::kOff}}};

struct SecondPassOptions {
  SecondPassMode mode = SecondPassMode::kAuto;
  bool companion = true;
  double min_confirmed = 0.5;
  bool drop_movers = true;
  SecondPassMeasurementOptions measurement;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Choice("mode",
             o.mode,
             kSecondPassModeNames,
             "After the last frame, reconstruct, and measure every feature again where the "
             "model says that it is. The tracks get more accurate, at the price of going "
             "through the video again; auto does it for the tracker subspace, strong and "
             "measured.",
             Tier::kCommon);
    v.Flag(
        "companion",
        o.companion,
        "Let KLT track features of its own where the tracker subspace loses most of its, and use "
        "them in the second pass: a camera too fast for it may not be too fast for KLT.",
        Tier::kCommon);
    VisitMeasurement(o, v);
  }

  // All but what the first pass is, for who has it already.
  template <typename Self, typename Visitor>
  static void VisitMeasurement(Self& o, Visitor& v) {
    v.Number("min_confirmed",
             o.min_confirmed,
             0.0,
             1.0,
             "The share of a feature's observations that must be found again where the model "
             "says; of a feature with less, the track stays as the first pass had it.",
             Tier::kCommon);
    v.Flag("drop_movers",
           o.drop_movers,
           "Drop tracks that no point of the rigid scene explains, such as those on "
           "somebody who walks by.",
           Tier::kCommon);
    SecondPassMeasurementOptions::Visit(o.measurement, v);
  }
};

// Of several rounds (WithSecondPass) those of the last one, but the movers of all.
struct SecondPassFigures {
  std::size_t before = 0;    // observations of the tracks that are replaced
  std::size_t kept = 0;      // of them, measured again
  std::size_t regained = 0;  // observations where there were none
  std::size_t replaced = 0;  // tracks
  std::size_t left = 0;      // tracks that have a point, but were not found again
  std::size_t masked = 0;    // tracks of which the mask leaves nothing: dropped
  std::size_t movers = 0;    // tracks dropped

  double Confirmed() const;  // kept, as a share
  void Add(const SecondPassFigures& other);
  std::string Brief() const;
};

struct SecondPass {
  TrackFile file;
  SecondPassFigures figures;
  std::string none_because;  // of WithSecondPass: why `file` is the first pass's; empty: it is not
};

// TrackFile::meta["second_pass_options"]: all but mode and companion, so that a file begun with
// `auto` is resumed with `on`.
std::string SecondPassOptionsText(const SecondPassOptions& options);

// TrackFile::meta["second_pass"]: not wanted, or still to come; then "done", or "none: " and why.
inline constexpr const char* kSecondPassOff = "off";
inline constexpr const char* kSecondPassAsked = "asked";

// Does no point of the scene, near or infinitely far, explain half of the track's observed
// positions to within `max_error_px`? Not said of fewer than ten frames with a pose.
bool MovesOtherwise(std::span<const Observation> track,
                    const Reconstruction& model,
                    double max_error_px);

// Tracks and their model -> tracks measured anew where the model's points are seen
// (SecondPassMeasurer). Where a feature is not seen between its sightings, or the first pass had
// it, the model predicts it. Tracks without a point or of which too little is found again, and
// frames without a pose, keep what they had; but tracks that MovesOtherwise are dropped: they are
// on something that crosses before the scene. `sequence`: the clip, rewound here; nothing is
// measured where `mask` (may be empty) is black. Throws Error where clip, model and tracks do not
// belong together.
SecondPass MeasureAgain(const TrackFile& file,
                        const Reconstruction& model,
                        Sequence& sequence,
                        const cv::Mat& mask,
                        const SecondPassOptions& options,
                        const StageProgress& progress = {});

// Does a model made since have many points elsewhere in the pictures than the first of `models`, so
// far that features were looked for in wrong places? Or frames that none of them had, or nothing in
// common?
bool HaveMoved(std::span<const Reconstruction> models,
               const Reconstruction& now,
               const SecondPassOptions& options);

// One set of the tracks of a first pass and of KLT's where that one loses its features, as the
// second pass takes them: without those that are twins of others or not needed. As it is, where no
// companion is wanted.
TrackFile JoinCompanion(TrackFile first_pass, Sequence& sequence, const cv::Mat& mask);

// The same with a model of its own, by Ceres, or one of each part of a clip that breaks; where
// there is none, `file` itself, whose meta["second_pass"] says why.
SecondPass WithSecondPass(TrackFile file,
                          Sequence& sequence,
                          const cv::Mat& mask,
                          const SecondPassOptions& options,
                          const StageProgress& progress = {});

}  // namespace cohort
