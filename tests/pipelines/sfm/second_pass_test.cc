#include "pipelines/sfm/second_pass.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <opencv2/imgproc.hpp>
#include <utility>
#include <vector>

#include "frontend/core/statistics.h"
#include "pipelines/sfm/masks.h"
#include "pipelines/sfm/model_predictions.h"
#include "tests/support/plane_clip.h"
#include "tests/support/zoom.h"

namespace cohort {
namespace {

// The first pass saw every feature in every frame; in one frame, something hides the left half.
class SecondPassOfPlanes : public testing::Test {
 protected:
  static constexpr int kFrames = 12;
  static constexpr int kHidden = 7;

  SecondPassOfPlanes() : clip_(kFrames) {
    clip_.Picture(kHidden).colRange(0, 160).setTo(40);
    model_.camera = clip_.scene().camera();
    model_.cam_from_world = clip_.TrueCamFromWorld();
    file_.width_px = model_.camera.width_px;
    file_.height_px = model_.camera.height_px;
    for (int i = 0; i < kFrames; ++i) {
      file_.frames.push_back({FrameIndex{static_cast<std::uint32_t>(i)}, "", 0});
    }
    std::vector<Observation> observations;
    for (int y = 50; y < 200; y += 30) {
      for (int x = 50; x < 290; x += 30) {
        AddFeature(FeatureId{static_cast<std::uint32_t>(1000 * y + x)},
                   {static_cast<double>(x), static_cast<double>(y)},
                   observations);
      }
    }
    file_.tracks = TrackSet::Build(std::move(observations));
  }

  // The point of the scene that xy shows in the middle of the clip.
  void AddFeature(FeatureId feature,
                  const Eigen::Vector2d& xy,
                  std::vector<Observation>& observations) {
    const auto point = clip_.scene().PointAt(test::PlaneScene::CamFromWorld(kFrames / 2), xy);
    if (!point) return;
    for (const auto& [frame, cam_from_world] : model_.cam_from_world) {
      Observation& o = observations.emplace_back();
      o.feature = feature;
      o.frame = frame;
      o.xy = *model_.camera.Project(cam_from_world * *point);
    }
    model_.points[feature].in_world = *point;
  }

  test::PlaneClip clip_;
  Reconstruction model_;
  TrackFile file_;
};

TEST_F(SecondPassOfPlanes, PredictsWhatIsHiddenAsUncertainAsTheMeanOfItsSightings) {
  const SecondPass second = MeasureAgain(file_, model_, clip_, {});
  std::size_t predicted = 0;
  for (const FeatureId feature : second.file.tracks.features()) {
    Eigen::Matrix2d sum = Eigen::Matrix2d::Zero();
    double sightings = 0.0;
    const Observation* hidden = nullptr;
    for (const Observation& o : second.file.tracks.Track(feature)) {
      if (!o.covariance) {  // not found again: the first pass's, which has none here
        ASSERT_EQ(sightings, 0.0);
        break;
      }
      if (o.state == ObservationState::kObserved) {
        sum += o.covariance->Matrix();
        sightings += 1.0;
      } else if (o.frame == FrameIndex{kHidden}) {
        hidden = &o;
      }
    }
    if (hidden == nullptr) continue;
    ++predicted;
    const Eigen::Matrix2d mean = sum / sightings;
    EXPECT_LT((hidden->covariance->Matrix() - mean).norm(), 1e-4 * mean.norm()) << ToInt(feature);
    const Eigen::Vector2d by_model = *model_.camera.Project(
        model_.cam_from_world.at(hidden->frame) * model_.points.at(feature).in_world);
    EXPECT_LT((hidden->xy - by_model).norm(), 1e-9) << ToInt(feature);
  }
  EXPECT_GE(predicted, 10u);
  EXPECT_GT(second.figures.Confirmed(), 0.8);
}

// Four sets of features that were observed one after the other, in places that all frames show: those
// of a camera that comes back again and again.
TEST_F(SecondPassOfPlanes, MeasuresTwiceAsManyFeaturesAtMostAsTheFirstPassObservedInAFrame) {
  constexpr std::uint32_t kSets = 4;
  constexpr std::uint32_t kFramesOfSet = kFrames / kSets;
  const auto set_of = [](FeatureId feature) { return ToInt(feature) / 10 % kSets; };
  std::vector<Observation> observations(file_.tracks.observations().begin(),
                                        file_.tracks.observations().end());
  std::erase_if(observations, [&](const Observation& o) {
    return ToInt(o.frame) / kFramesOfSet != set_of(o.feature);
  });
  file_.tracks = TrackSet::Build(std::move(observations));
  std::size_t most_observed = 0;
  for (std::uint32_t i = 0; i < kFrames; ++i) {
    most_observed = std::max(most_observed, file_.tracks.InFrame(FrameIndex{i}).size());
  }
  ASSERT_LT(2 * most_observed, file_.tracks.features().size());
  const ModelPredictions predictions(file_, model_, 3);
  for (std::uint32_t i = 0; i < kFrames; ++i) {
    std::size_t observed = 0;
    const std::vector<ModelPrediction> in_sight = predictions.InSight(FrameIndex{i});
    for (const ModelPrediction& p : in_sight) observed += p.observed_in_first_pass ? 1 : 0;
    EXPECT_LE(in_sight.size(), 2 * most_observed) << "frame " << i;
    EXPECT_EQ(observed, file_.tracks.InFrame(FrameIndex{i}).size()) << "frame " << i;
    EXPECT_TRUE(std::ranges::is_sorted(in_sight, {}, &ModelPrediction::feature)) << "frame " << i;
  }
}

// A model that has one feature elsewhere: of that feature alone the first pass's track stays.
TEST_F(SecondPassOfPlanes, WhatIsNotFoundAgainStaysAsItWas) {
  const FeatureId wrong = file_.tracks.features()[10];
  model_.points.at(wrong).in_world *= 0.4;  // slides over what lies behind
  const SecondPass second = MeasureAgain(file_, model_, clip_, {});
  EXPECT_GE(second.figures.left, 1u);
  EXPECT_LE(second.figures.left, 4u);
  EXPECT_GT(second.figures.replaced, 20u);
  const auto before = file_.tracks.Track(wrong);
  const auto after = second.file.tracks.Track(wrong);
  ASSERT_EQ(after.size(), before.size());
  for (std::size_t i = 0; i < after.size(); ++i) EXPECT_EQ(after[i].xy, before[i].xy);
}

// Pictures that grow by a third: templates are taken, and looked for, with the frame's own camera.
TEST_F(SecondPassOfPlanes, FindsTheFeaturesOfAZoom) {
  std::vector<Observation> observations(file_.tracks.observations().begin(),
                                        file_.tracks.observations().end());
  const Eigen::Vector2d middle(model_.camera.cx, model_.camera.cy);
  for (int i = 0; i < kFrames; ++i) {
    const double scale = 1.0 + 0.03 * i;
    model_.focal_scale[FrameIndex(i)] = scale;
    const Eigen::Vector2d shift = (1.0 - scale) * middle;
    const cv::Mat zoom = (cv::Mat_<double>(2, 3) << scale, 0.0, shift.x(), 0.0, scale, shift.y());
    cv::Mat zoomed;
    cv::warpAffine(clip_.Picture(i), zoomed, zoom, clip_.Picture(i).size(), cv::INTER_CUBIC);
    clip_.Picture(i) = zoomed;
  }
  for (Observation& o : observations) {
    o.xy = middle + model_.focal_scale.at(o.frame) * (o.xy - middle);
  }
  file_.tracks = TrackSet::Build(std::move(observations));
  const SecondPass second = MeasureAgain(file_, model_, clip_, {});
  EXPECT_GE(second.figures.replaced, 20u) << second.figures.Brief();
  EXPECT_LE(second.figures.left, 2u) << second.figures.Brief();
  std::vector<double> errors_px;
  for (const Observation& o : second.file.tracks.observations()) {
    if (!IsObserved(o) || !o.covariance) continue;
    const auto by_model =
        CameraOf(model_, o.frame)
            .Project(model_.cam_from_world.at(o.frame) * model_.points.at(o.feature).in_world);
    errors_px.push_back((o.xy - *by_model).norm());
  }
  // Patches at the rim of a plane go with what moves in front.
  EXPECT_LT(Quantile(errors_px, 0.8), 0.5);
  EXPECT_GT(errors_px.size(), 250u);
}

TEST_F(SecondPassOfPlanes, MeasuresNothingBehindTheMask) {
  cv::Mat mask(file_.height_px, file_.width_px, CV_8UC1, cv::Scalar(255));
  mask.rowRange(0, 120).setTo(0);
  MaskedSequence masked(std::make_unique<test::PlaneClip>(kFrames), ClipMasks(mask, "mask"));
  const SecondPass second = MeasureAgain(file_, model_, masked, {});
  ASSERT_FALSE(second.file.tracks.observations().empty());
  for (const Observation& o : second.file.tracks.observations()) EXPECT_GT(o.xy.y(), 118.0);
}

// What passes in front of the scene is masked in the frames that show it.
TEST_F(SecondPassOfPlanes, MeasuresNothingBehindTheMaskOfAFrame) {
  constexpr FrameIndex kMasked{5};
  auto clip = std::make_unique<test::PlaneClip>(kFrames);
  clip->Mask(5) = cv::Mat(file_.height_px, file_.width_px, CV_8UC1, cv::Scalar(255));
  clip->Mask(5).rowRange(0, 120).setTo(0);
  const SecondPass second = MeasureAgain(file_, model_, *clip, {});
  std::size_t above = 0;
  for (const Observation& o : second.file.tracks.observations()) {
    if (o.xy.y() < 118.0) ++above;
    if (o.frame == kMasked) {
      EXPECT_GT(o.xy.y(), 118.0);
    }
  }
  EXPECT_GT(above, 100u);
}

TEST_F(SecondPassOfPlanes, RefusesAnotherClip) {
  test::PlaneClip shorter(kFrames - 1);
  EXPECT_THROW(MeasureAgain(file_, model_, shorter, {}), Error);
}

}  // namespace
}  // namespace cohort
