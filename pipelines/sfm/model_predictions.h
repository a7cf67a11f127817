#pragma once

#include <Eigen/Core>
#include <map>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "backend/scene/reconstruction.h"
#include "backend/scene/row_poses.h"
#include "frontend/track/second_pass_measurer.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// Where a model has the points of its features in every frame, and how they look there. A feature's
// template is of the `template_frames` frames around the middle of those that observed it.
class ModelPredictions {
 public:
  // Nothing is in sight where `mask` (may be empty) is black. All but the number must outlive this.
  ModelPredictions(const TrackFile& file,
                   const Reconstruction& model,
                   const cv::Mat& mask,
                   int template_frames);

  // Of the features whose template the frame is to enter.
  std::vector<ModelPrediction> ForTemplates(FrameIndex frame) const;
  // Of all features that can be measured in the frame.
  std::vector<ModelPrediction> InSight(FrameIndex frame) const;
  // Are both the feature's point and the frame's camera in the model?
  bool Knows(FeatureId feature, FrameIndex frame) const;
  bool HasMask() const { return !mask_.empty(); }
  bool IsMasked(const Eigen::Vector2d& xy) const;  // of a position in the picture
  // Where the model has the point of a feature that it knows; none off the picture or the mask.
  std::optional<Eigen::Vector2d> InPicture(FeatureId feature, FrameIndex frame) const;

 private:
  std::optional<Eigen::Vector2d> Project(const Eigen::Vector3d& in_world, FrameIndex frame) const;
  // Derivative of the picture in `frame` by that in `from`, for a patch that faces `from`'s camera.
  std::optional<Eigen::Matrix2d> Warp(FeatureId feature, FrameIndex from, FrameIndex frame) const;

  const TrackFile& file_;
  const Reconstruction& model_;
  RowPoses rows_;
  const cv::Mat& mask_;
  std::map<FeatureId, FrameIndex> middle_;  // whose view the template is
  std::map<FrameIndex, std::vector<FeatureId>> template_features_;
};

}  // namespace cohort
