#pragma once

#include <Eigen/Core>
#include <map>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <span>
#include <vector>

#include "frontend/core/options.h"
#include "frontend/image/frame.h"
#include "frontend/image/pyramid.h"
#include "frontend/track/measure/measurement.h"
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

// Where a reconstruction predicts a feature in a frame.
struct ModelPrediction {
  FeatureId feature{};
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();
  // From the feature's template to this frame, as AnchorPatch::warp.
  Eigen::Matrix2d warp = Eigen::Matrix2d::Identity();
  bool observed_in_first_pass = false;
};

// Measures every feature again where a reconstruction predicts it: without constraint, against one
// template for all of its track. The template is the mean of several neighbouring frames, brought
// to one shape by the predictions' warps, so it has less noise than any single frame. A frame is
// compared with the mean of the others alone: its own noise would hold it where it was predicted,
// and the model would confirm itself. This takes two passes over the clip:
//
//   SecondPassMeasurer measurer(options);
//   for each frame: measurer.Learn(frame, predictions of features whose template it enters);
//   for each frame: measurer.Measure(frame, predictions of all features that should be visible);
//   std::vector<Observation> observations = measurer.Finish();
//
// Both passes have the same frames in ascending order, with the same prediction of a feature in a
// frame.
//
// A feature is measured with a narrow and with a wide patch. The patch whose first dozen positions
// lie nearer to the predictions is used for all of its track: a wide patch has less noise, a narrow
// one includes less of what does not move with the feature.
//
// A measurement counts as observed if it lies near the prediction and correlates with the template
// nearly as well as where the first pass saw the feature; this rejects occluders. No measurement of
// a feature counts if its template correlates, over the whole track, no better than with other
// places: in the dark, noise alone resembles any template a little. Covariances are the inverse
// gradient energy, scaled by one factor for all frames, which makes the distances from the
// predictions as large as expected.
class SecondPassMeasurer {
 public:
  explicit SecondPassMeasurer(const SecondPassMeasurementOptions& options);
  void Learn(const Frame& frame, std::span<const ModelPrediction> predictions);
  void Measure(const Frame& frame, std::span<const ModelPrediction> predictions);
  std::vector<Observation> Finish() const;  // all observed; ascending features, frames

 private:
  // A picture with 16 bits a pixel over its own range: a long clip has tens of thousands of
  // templates, each of two pictures of 61 px a side.
  struct PackedPicture {
    cv::Mat levels;
    double least = 0.0;
    double step = 0.0;  // from one level to the next

    static PackedPicture Of(const cv::Mat& picture);
    cv::Mat Unpacked() const;
  };
  struct Template {
    AnchorPatch sum;
    std::vector<FrameIndex> frames;
    PackedPicture full;  // of the mean of all frames, once learnt
    PackedPicture half;
    std::vector<double> signal_variances;  // of the mean, for each window
  };
  // The part of a feature's warp that the predictions miss (a slanted surface), frame to frame.
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
    double residual_variance_ratio = 0.0;  // relative to the noise
    double residual = 0.0;
    Eigen::Vector2d xy = Eigen::Vector2d::Zero();
    Eigen::Matrix2d shape = Eigen::Matrix2d::Identity();
  };
  // The correlations of templates with places that do not show their feature: as for the feature
  // itself, the best within reach counts.
  struct Chance {
    double sum = 0.0;
    double count = 0.0;
  };
  // All measurements with patches of one size.
  struct Window {
    int px = 0;
    double noise_variance = 0.0;  // of picture minus template
    Chance chance;
    std::map<FeatureId, Deformation> deformations;
    std::map<FeatureId, std::vector<Sighting>> sightings;
  };

  void Finish(Template& t) const;  // when it has all its frames
  void FinishTemplates();
  // The template without what this frame contributed to it.
  AnchorPatch WithoutItself(const Template& t,
                            FrameIndex frame,
                            const ModelPrediction& prediction,
                            const Pyramid& pyramid) const;
  void MeasureWith(Window& window,
                   const Frame& frame,
                   std::span<const ModelPrediction> predictions,
                   const Pyramid& pyramid) const;
  // Compares a feature's windows: the sums of their squared distances from the predictions [px^2],
  // in the same frames.
  struct Contest {
    std::vector<double> squares;
    double count = 0.0;
    std::optional<std::size_t> winner = {};
  };

  // The correlations of a feature's measurements near their predictions.
  std::vector<double> CorrelationsOf(FeatureId feature, const Window& window) const;
  void CompareWindows(FrameIndex frame, std::span<const ModelPrediction> predictions);
  // The window with the least mean square; sums of few frames are shrunk towards those of all.
  std::size_t NearestWindow(const Contest& contest, const Contest& all) const;
  // The winner of every feature's contest; the current best if the contest is undecided.
  std::map<FeatureId, const Window*> ChosenWindows() const;

  SecondPassMeasurementOptions options_;
  std::map<FeatureId, Template> templates_;
  bool learnt_ = false;
  std::vector<Window> windows_;  // ascending
  std::map<FeatureId, Contest> contests_;
  Contest all_contests_;
};

}  // namespace cohort
