#include "backend/grow/growth.h"

#include <gtest/gtest.h>

#include "tests/backend/scene/true_model.h"

namespace cohort {
namespace {

using test::AllFrames;
using test::Ate;
using test::LateralScene;
using test::SyntheticTracks;
using test::TrueModel;

TEST(Growth, GoesFromAStartOverAllKeyframesAndNoFurther) {
  const SyntheticTracks scene = LateralScene();
  const WhitenedTracks whitened(scene.file, {});
  WorkingModel model = TrueModel(scene, whitened, {8, 12});
  const std::vector<int> keyframes{0, 4, 8, 12, 16, 20};
  GrowModel(model, keyframes);
  EXPECT_EQ(model.RegisteredFrames(), keyframes);
  EXPECT_LT(Ate(model, scene), 0.01);
}

TEST(Growth, TheOtherFramesFollow) {
  const SyntheticTracks scene = LateralScene();
  const WhitenedTracks whitened(scene.file, {});
  WorkingModel model = TrueModel(scene, whitened, {8, 12, 16});
  RegisterOtherFrames(model);
  EXPECT_EQ(model.RegisteredFrames(), AllFrames(whitened));
  EXPECT_LT(Ate(model, scene), 0.01);
}

TEST(Growth, StopsWhereTheTracksBreakOff) {
  SyntheticTracks scene = LateralScene();
  std::vector<Observation> observations;
  for (Observation o : scene.file.tracks.observations()) {
    if (ToInt(o.frame) >= 14) o.feature = FeatureId{ToInt(o.feature) + 100000};
    observations.push_back(o);
  }
  scene.file.tracks = TrackSet::Build(std::move(observations));
  const WhitenedTracks whitened(scene.file, {});
  WorkingModel model = TrueModel(scene, whitened, {4, 10});
  GrowModel(model, {0, 4, 10, 13, 14, 18});
  EXPECT_EQ(model.RegisteredFrames(), (std::vector<int>{0, 4, 10, 13}));
}

}  // namespace
}  // namespace cohort
