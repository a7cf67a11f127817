#pragma once

#include "frontend/core/options.h"
#include "frontend/energy/penalty.h"

namespace cohort {

enum class TrackerKind { kSubspace, kDescent, kKlt, kAnchoredKlt, kRlof, kDis, kDeepFlow };
inline constexpr ChoiceNames<TrackerKind, 7> kTrackerNames{
    {{"subspace", TrackerKind::kSubspace},
     {"descent", TrackerKind::kDescent},
     {"klt", TrackerKind::kKlt},
     {"anchored-klt", TrackerKind::kAnchoredKlt},
     {"rlof", TrackerKind::kRlof},
     {"dis", TrackerKind::kDis},
     {"deepflow", TrackerKind::kDeepFlow}}};

// Shi-Tomasi corners on a denoised image, spread over a grid; the same for every tracker.
struct DetectorOptions {
  int max_features = 400;
  int grid_columns = 8;
  int grid_rows = 6;
  double quality = 0.01;
  double min_over_noise = 5.0;
  double min_distance_px = 10.0;
  double denoise_sigma_px = 1.5;
  int block_px = 7;
  double redetect_below = 0.8;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("max_features",
             o.max_features,
             1,
             100000,
             "How many features are alive at a time. More features give better cameras and "
             "more points; the time grows in proportion.",
             Tier::kCommon);
    v.Number("grid_columns",
             o.grid_columns,
             1,
             256,
             "cells across; each gets an equal share of corners");
    v.Number("grid_rows", o.grid_rows, 1, 256, "cells down");
    v.Number("quality",
             o.quality,
             1e-6,
             1.0,
             "least corner strength, as a share of the frame's strongest");
    v.Number("min_over_noise",
             o.min_over_noise,
             0.0,
             1e6,
             "least corner strength, as a multiple of what the picture's noise alone has");
    v.Number("min_distance_px", o.min_distance_px, 1.0, 1000.0, "between features [px]");
    v.Number(
        "denoise_sigma_px", o.denoise_sigma_px, 0.0, 20.0, "Gaussian blur before detection [px]");
    v.Number("block_px", o.block_px, 3, 31, "side of the corner detector's window [px]");
    v.Number(
        "redetect_below",
        o.redetect_below,
        0.0,
        1.0,
        "new corners are sought when the features alive fall below this share of max_features");
  }
};

// Baseline: pyramidal Lucas-Kanade of OpenCV with a forward-backward check.
struct KltOptions {
  int window_px = 21;
  int max_level = 3;
  double forward_backward_px = 1.0;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("window_px", o.window_px, 3, 101, "side of the tracked patch [px], odd");
    v.Number("max_level", o.max_level, 0, 8, "pyramid levels above full resolution");
    v.Number("forward_backward_px",
             o.forward_backward_px,
             0.0,
             100.0,
             "a feature ends if tracking back misses its start by more [px]; 0: no check");
  }
};

// Baseline: the same from frame to frame as a guide, then once more against the feature's first
// frame.
struct AnchoredKltOptions {
  int window_px = 21;
  int guide_max_level = 3;
  int anchor_max_level = 1;
  double max_distance_px = 3.0;
  double forward_backward_px = 1.0;
  int max_unconfirmed_frames = 5;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("window_px", o.window_px, 3, 101, "side of the tracked patch [px], odd");
    v.Number("guide_max_level",
             o.guide_max_level,
             0,
             8,
             "pyramid levels above full resolution, from frame to frame");
    v.Number("anchor_max_level", o.anchor_max_level, 0, 8, "the same against the first frame");
    v.Number("max_distance_px",
             o.max_distance_px,
             0.1,
             50.0,
             "from the guide [px]; further is unconfirmed");
    v.Number("forward_backward_px",
             o.forward_backward_px,
             0.01,
             100.0,
             "unconfirmed if tracking back misses the place in the first frame by more [px]");
    v.Number("max_unconfirmed_frames",
             o.max_unconfirmed_frames,
             0,
             100000,
             "a feature unconfirmed for more frames in a row ends");
  }
};

// Baseline: robust local optical flow of OpenCV.
struct RlofOptions {
  int window_px = 31;
  int max_level = 4;
  bool robust = true;
  bool illumination_model = false;
  bool global_motion = true;
  double forward_backward_px = 1.0;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("window_px", o.window_px, 3, 101, "side of the tracked patch [px], odd");
    v.Number("max_level", o.max_level, 0, 8, "pyramid levels above full resolution");
    v.Flag("robust", o.robust, "Hampel's norm in place of least squares");
    v.Flag("illumination_model", o.illumination_model, "estimate gain and offset of every patch");
    v.Flag("global_motion", o.global_motion, "start at the motion of the whole picture");
    v.Number("forward_backward_px",
             o.forward_backward_px,
             0.0,
             100.0,
             "a feature ends if tracking back misses its start by more [px]; 0: no check");
  }
};

// Baselines: tracks chained from dense flow.
struct DenseFlowOptions {
  double denoise_sigma_px = 0.8;
  double forward_backward_px = 0.7071;
  double forward_backward_share = 0.01;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("denoise_sigma_px", o.denoise_sigma_px, 0.0, 10.0, "Gaussian blur before [px]");
    v.Number("forward_backward_px",
             o.forward_backward_px,
             0.0,
             100.0,
             "a feature ends if the flow back misses its start by more [px]; 0: no check");
    v.Number("forward_backward_share",
             o.forward_backward_share,
             0.0,
             1.0,
             "of both flows' squared lengths, which is allowed in addition");
  }
};

// How hard the penalty pulls, paper equation (7).
enum class Constraint {
  kStrong,  // alpha = 1 / (m F n^2): the scene is rigid; no few features can overpower it
  kWeak,    // alpha = 1 / (m n^2): as much say as a single feature
};
inline constexpr ChoiceNames<Constraint, 2> kConstraintNames{
    {{"strong", Constraint::kStrong}, {"weak", Constraint::kWeak}}};

enum class OptimizerKind {
  kAlgorithm1,   // the paper's first-order descent
  kJointNewton,  // damped Newton steps of all features together
};
inline constexpr ChoiceNames<OptimizerKind, 2> kOptimizerNames{
    {{"algorithm-1", OptimizerKind::kAlgorithm1}, {"joint-newton", OptimizerKind::kJointNewton}}};

// m of eq. (7) relative to the picture's contrast: that with which the guide's worst level of
// darkness is nearest to that level's own best (docs/paper.md).
inline double CalibratedWeight(PenaltyKind penalty, Constraint constraint) {
  const bool strong = constraint == Constraint::kStrong;
  switch (penalty) {
    case PenaltyKind::kExplicitFactorization:
      return strong ? 0.02 : 0.8;
    case PenaltyKind::kNuclearNorm:
      return strong ? 0.0084 : 0.34;
    case PenaltyKind::kEmpiricalDimension:
      break;
  }
  return strong ? 1.0 : 40.0;
}

// The paper's joint tracker. Its first-order single-feature tracker (`descent`) shares the template
// size.
struct SubspaceOptions {
  Constraint constraint = Constraint::kStrong;
  PenaltyKind penalty = PenaltyKind::kEmpiricalDimension;
  bool uncentered = false;
  int history_length = 10;
  int template_px = 11;
  double penalty_weight = 1.0;
  double epsilon = 0.6;
  double smoothing_px = 0.15;
  OptimizerKind optimizer = OptimizerKind::kJointNewton;
  int min_iterations = 4;
  int max_iterations = 20;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Choice(
        "constraint",
        o.constraint,
        kConstraintNames,
        "How hard the features hold each other. Strong needs a scene that is mostly rigid; weak "
        "gives their joint motion no more say than a single feature's patch has.",
        Tier::kCommon);
    v.Choice("penalty",
             o.penalty,
             kPenaltyNames,
             "What measures the dimension of the joint motion, equations (4) to (6) of the "
             "paper; it is small where the scene is rigid.",
             Tier::kCommon);
    v.Flag("uncentered",
           o.uncentered,
           "Leave the features' mean motion in before its dimension is measured: that of a"
           " rigid scene is then 4, not 3.",
           Tier::kCommon);
    v.Number("history_length",
             o.history_length,
             1,
             60,
             "How many past frames the features hold each other over, the L of the paper. "
             "More frames tell true motion from noise better; the time grows.",
             Tier::kCommon);
    v.Number("template_px", o.template_px, 3, 63, "n: side of the template [px], odd");
    v.Number("penalty_weight",
             o.penalty_weight,
             0.0,
             1e9,
             "m of eq. (7), as a multiple of the calibrated one");
    v.Number("epsilon", o.epsilon, 0.01, 1.0, "of the empirical dimension, eq. (6)");
    v.Number("smoothing_px",
             o.smoothing_px,
             0.0,
             10.0,
             "rounds the penalty at singular values of 0 [px]");
    v.Choice("optimizer", o.optimizer, kOptimizerNames, "how the total energy is minimised");
    v.Number("min_iterations", o.min_iterations, 1, 1000, "min_i of Algorithm 1, per level");
    v.Number("max_iterations", o.max_iterations, 1, 1000, "max_i of Algorithm 1, per level");
  }
};

// The tracker of the paper's section 4, to be run with the measurement off. What it does not print
// is ours: m (its supplement has it), the template's side of its timing, the limits of iterations.
inline SubspaceOptions PaperSubspaceOptions() {
  SubspaceOptions options;
  options.constraint = Constraint::kWeak;
  options.template_px = 7;
  options.optimizer = OptimizerKind::kAlgorithm1;
  return options;
}

// Guide, then measure: the guided position starts one unconstrained alignment of a larger patch
// with the feature's anchor; what the image does not confirm stays predicted.
struct MeasurementOptions {
  bool enabled = true;
  int window_px = 21;
  int wide_window_px = 31;
  double wide_above_px = 0.5;
  double denoise_sigma_px = 0.8;
  double max_distance_px = 5.0;
  double min_correlation = 0.3;
  double max_residual_ratio = 2.0;
  double max_center_ratio = 4.0;
  int small_window_px = 11;
  double max_sigma_px = 4.0;
  double max_disagreement_px = 3.0;
  double max_disagreement_sigmas = 5.0;
  double max_open_px = 1.5;
  int max_rank = 8;
  bool perspective = true;
  int max_unexplained_frames = 4;
  bool fuse = false;
  double warp_noise = 0.003;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Flag("enabled", o.enabled, "measure every guided position against the feature's anchor");
    v.Number("window_px", o.window_px, 5, 63, "side of the measured patch [px], odd");
    v.Number("wide_window_px",
             o.wide_window_px,
             5,
             63,
             "the same until a feature is seen to be measured well [px], odd");
    v.Number("wide_above_px",
             o.wide_above_px,
             0.0,
             1000.0,
             "deviation of a position above which it is not measured well [px]");
    v.Number(
        "denoise_sigma_px", o.denoise_sigma_px, 0.0, 10.0, "Gaussian blur before measuring [px]");
    v.Number("max_distance_px",
             o.max_distance_px,
             0.1,
             50.0,
             "from the guide [px]; further is unconfirmed");
    v.Number(
        "min_correlation", o.min_correlation, 0.0, 1.0, "with the anchor; less is unconfirmed");
    v.Number("max_residual_ratio",
             o.max_residual_ratio,
             1.0,
             100.0,
             "residual variance over what noise explains; more is unconfirmed");
    v.Number("warp_noise",
             o.warp_noise,
             0.0,
             1.0,
             "how much a patch may deform from frame to frame, beyond what all do, as a share");
    v.Number("max_center_ratio",
             o.max_center_ratio,
             1.0,
             100.0,
             "the same of the innermost pixels; more is something else that hides the feature");
    v.Number("small_window_px",
             o.small_window_px,
             5,
             63,
             "side of the patch that is tried where the large one fails [px], odd");
    v.Number("max_sigma_px",
             o.max_sigma_px,
             0.1,
             1000.0,
             "of a measurement (strong mode); a worse one is unconfirmed; half of it for a feature "
             "that comes back [px]");
    v.Number("max_disagreement_px",
             o.max_disagreement_px,
             0.1,
             1000.0,
             "from where the other features say it is (strong mode) [px]; further is unconfirmed; "
             "what measurement and prediction leave open is allowed in addition:");
    v.Number("max_disagreement_sigmas",
             o.max_disagreement_sigmas,
             1.0,
             1000.0,
             "the same as a multiple of their deviation");
    v.Number(
        "max_open_px",
        o.max_open_px,
        0.0,
        1000.0,
        "what the others may leave open of where a feature is [px]; beyond, Lucas-Kanade gives its "
        "start and (strong mode) it must come back when tracked there and back; 0: neither");
    v.Number("max_rank",
             o.max_rank,
             2,
             8,
             "of the trajectory model, which starts at 2 and grows where the residuals ask for "
             "it; 3: one rigid body");
    v.Flag("perspective",
           o.perspective,
           "the trajectory model has projective cameras; off: affine ones");
    v.Number("max_unexplained_frames",
             o.max_unexplained_frames,
             0,
             100000,
             "a feature ends that for more frames in a row is not confirmed although nothing hides "
             "it, or that changes slowly; 0: no check");
    v.Flag(
        "fuse",
        o.fuse,
        "write the most probable positions, of the measurement and the other features: nearer to "
        "the truth, but no longer independent of each other, as bundle adjustment expects");
  }
};

struct TrackerOptions {
  TrackerKind tracker = TrackerKind::kSubspace;
  double border_px = 5.0;
  int birth_border_px = 16;
  int max_unconfirmed_frames = 20;
  DetectorOptions detector;
  KltOptions klt;
  AnchoredKltOptions anchored_klt;
  RlofOptions rlof;
  DenseFlowOptions dense_flow;
  SubspaceOptions subspace;
  MeasurementOptions measurement;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Choice(
        "tracker",
        o.tracker,
        kTrackerNames,
        "Which tracker follows the features: subspace all of them together, the others each of "
        "them alone. klt is what most programs use; subspace takes longer, and loses fewer "
        "in the dark.",
        Tier::kCommon);
    v.Number(
        "border_px", o.border_px, 0.0, 100.0, "a feature nearer to the image border ends [px]");
    v.Number("birth_border_px",
             o.birth_border_px,
             1,
             200,
             "no new features nearer to the image border [px]");
    v.Number("max_unconfirmed_frames",
             o.max_unconfirmed_frames,
             0,
             100000,
             "a feature that the image has not confirmed for more frames in a row ends");
    v.Group("detector", o.detector, "corner detection");
    v.Group("klt", o.klt, "tracker klt");
    v.Group("anchored_klt", o.anchored_klt, "tracker anchored-klt");
    v.Group("rlof", o.rlof, "tracker rlof");
    v.Group("dense_flow", o.dense_flow, "trackers dis and deepflow");
    v.Group("subspace", o.subspace, "tracker subspace");
    v.Group("measurement", o.measurement, "guide, then measure (tracker subspace)");
  }
};

}  // namespace cohort
