#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "frontend/core/options.h"
#include "frontend/image/frame.h"
#include "frontend/image/pyramid.h"
#include "frontend/track/measurement.h"
#include "frontend/tracks/observation.h"

namespace cohort {

struct SecondPassMeasurementOptions {
  PatchOptions patch{.max_distance_px = 3.0, .warp_noise = 0.05};
  int template_frames = 21;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    PatchOptions::Visit(o.patch, v);
    v.Number("template_frames",
             o.template_frames,
             1,
             99,
             "frames whose mean is a feature's template, around the middle of its track");
  }
};

// Where a reconstruction says that a feature is in a frame.
struct ModelPrediction {
  FeatureId feature{};
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();
  // From the feature's template to this frame, as AnchorPatch::warp.
  Eigen::Matrix2d warp = Eigen::Matrix2d::Identity();
  bool observed_in_first_pass = false;
};

// Measures every feature anew where a reconstruction says that it is: without constraint, against
// one template for all of its track. The template is the mean of some neighbouring frames, brought
// to one shape by the predictions' warps, so it has less noise than any. Goes through the clip
// twice:
//
//   SecondPassMeasurer measurer(options);
//   for each frame: measurer.Learn(frame, predictions of those whose template it is to enter);
//   for each frame: measurer.Measure(frame, predictions of all that should be in sight);
//   std::vector<Observation> observations = measurer.Finish();
//
// A feature is measured with a narrow and with a wide patch; of the two, the one whose first dozen
// positions lie nearer to the predictions is taken for all of its track: a wide patch has less
// noise, a narrow one shows less of what does not move with the feature.
//
// What is found counts as observed if it lies near the prediction and looks as much like its
// template as it does where the first pass saw it; so an occluder is not taken for the feature.
// Covariances are the inverse gradient energy, in all frames with one factor: such that the
// distances from the predictions are as expected.
class SecondPassMeasurer {
 public:
  explicit SecondPassMeasurer(const SecondPassMeasurementOptions& options);
  void Learn(const Frame& frame, std::span<const ModelPrediction> predictions);
  void Measure(const Frame& frame, std::span<const ModelPrediction> predictions);
  std::vector<Observation> Finish() const;  // all observed; ascending features, frames

 private:
  struct Template {
    AnchorPatch sum;
    int frames = 0;
    AnchorPatch mean;                      // of the two, once learnt
    std::vector<double> signal_variances;  // of the mean, for each window
  };
  // What the predictions miss of a feature's warp (a slanted surface), from frame to frame.
  struct Deformation {
    Eigen::Matrix2d beyond_prediction = Eigen::Matrix2d::Identity();
    Eigen::Matrix4d covariance = Eigen::Matrix4d::Zero();
  };
  struct Sighting {
    FrameIndex frame{};
    bool observed_before = false;
    double distance_px = 0.0;  // from the prediction
    double mahalanobis2 = 0.0;
    double correlation = 0.0;
    double residual_variance_ratio = 0.0;  // to what noise explains
    double residual = 0.0;
    Eigen::Vector2d xy = Eigen::Vector2d::Zero();
    Eigen::Matrix2d shape = Eigen::Matrix2d::Identity();
  };
  // All measurements with patches of one size.
  struct Window {
    int px = 0;
    double noise_variance = 0.0;  // of a picture's difference to a template
    std::map<FeatureId, Deformation> deformations;
    std::map<FeatureId, std::vector<Sighting>> sightings;
  };

  void FinishTemplates();
  void MeasureWith(Window& window,
                   const Frame& frame,
                   std::span<const ModelPrediction> predictions,
                   const Pyramid& pyramid) const;
  // A feature's windows against each other: the sums of their squared distances from the
  // predictions [px^2], in the same frames.
  struct Contest {
    std::vector<double> squares;
    double count = 0.0;
    std::optional<std::size_t> winner = {};
  };

  void CompareWindows(FrameIndex frame, std::span<const ModelPrediction> predictions);
  // Of few frames' sums, drawn to those of all features.
  std::size_t NearestWindow(const Contest& contest, const Contest& all) const;
  // The winner of every feature's contest; of one that is not decided, as it stands.
  std::map<FeatureId, const Window*> ChosenWindows() const;

  SecondPassMeasurementOptions options_;
  std::map<FeatureId, Template> templates_;
  bool learnt_ = false;
  std::vector<Window> windows_;  // ascending
  std::map<FeatureId, Contest> contests_;
  Contest all_contests_;
};

}  // namespace cohort
