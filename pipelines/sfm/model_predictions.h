#pragma once

#include <Eigen/Core>
#include <map>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <set>
#include <vector>

#include "backend/scene/reconstruction.h"
#include "backend/scene/row_poses.h"
#include "frontend/track/second_pass/second_pass_measurer.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// Derivative of the picture in `to` with respect to that in `from` at a point of the world, for a
// surface that faces `from`'s camera; nullopt if it is not in front of both cameras.
std::optional<Eigen::Matrix2d> WarpOfFacingPatch(const Reconstruction& model,
                                                 const RowPoses& rows,
                                                 const Eigen::Vector3d& in_world,
                                                 FrameIndex from,
                                                 FrameIndex to);

// Whether a patch can be measured: it appears at most twice as large, or as small, as its template.
bool IsMeasurable(const Eigen::Matrix2d& warp);

// Where a model predicts the points of its features in every frame, and how their appearance is
// warped. A feature's template spans the `template_frames` frames around the middle of those that
// observed it.
class ModelPredictions {
 public:
  // All but the number must outlive this.
  ModelPredictions(const TrackFile& file, const Reconstruction& model, int template_frames);

  // From now on no feature is visible where the frame's mask (may be empty) is black. It stores
  // what the mask covers instead of the mask, since those of all frames may need more memory than
  // there is.
  void Mask(FrameIndex frame, const cv::Mat& mask);
  // Predicts the features whose template includes the frame.
  std::vector<ModelPrediction> ForTemplates(FrameIndex frame) const;
  // Predicts the features that can be measured in the frame: all of them, up to a bound.
  std::vector<ModelPrediction> InSight(FrameIndex frame) const;
  // Whether both the feature's point and the frame's camera are in the model.
  bool Knows(FeatureId feature, FrameIndex frame) const;
  bool HasMask() const { return has_mask_; }
  bool IsMasked(const Observation& observation) const;  // of the file
  // Whether all pixels around it are, too: not so for one born at the edge of the same mask.
  bool IsInsideMask(const Observation& observation) const;
  // The position of a feature that the model knows; nullopt off the picture or the mask.
  std::optional<Eigen::Vector2d> InPicture(FeatureId feature, FrameIndex frame) const;

 private:
  struct Seen {
    FrameIndex middle{};           // the template has its view
    std::size_t observations = 0;  // of the first pass, in frames of the model
  };

  void KeepBest(std::vector<ModelPrediction>& predictions) const;
  std::optional<Eigen::Vector2d> Project(const Eigen::Vector3d& in_world, FrameIndex frame) const;
  // Of a patch that faces `from`'s camera.
  std::optional<Eigen::Matrix2d> Warp(FeatureId feature, FrameIndex from, FrameIndex frame) const;

  const TrackFile& file_;
  const Reconstruction& model_;
  RowPoses rows_;
  bool has_mask_ = false;
  // By frame: the observed features of the file, and the predicted ones, that the mask covers.
  std::map<FrameIndex, std::set<FeatureId>> masked_;
  std::map<FrameIndex, std::set<FeatureId>> inside_mask_;  // of all of the file
  std::map<FrameIndex, std::set<FeatureId>> hidden_;
  std::map<FeatureId, Seen> features_;
  std::map<FrameIndex, std::vector<FeatureId>> template_features_;
  std::size_t most_in_sight_ = 0;
};

}  // namespace cohort
