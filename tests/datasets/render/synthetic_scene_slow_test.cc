// Every scene on every path: its pictures agree with its truth.
#include <gtest/gtest.h>

#include <string>
#include <tuple>
#include <vector>

#include "datasets/render/synthetic_scene.h"
#include "tests/datasets/render/displacement.h"

namespace cohort {
namespace {

template <typename Enum, std::size_t N>
std::vector<Enum> ValuesOf(const ChoiceNames<Enum, N>& names) {
  std::vector<Enum> values;
  for (const auto& [name, value] : names) values.push_back(value);
  return values;
}

class EveryScene : public testing::TestWithParam<std::tuple<SceneName, Motion>> {};

TEST_P(EveryScene, TruthAndPicturesAgreeBetweenFrames) {
  SyntheticSceneOptions options;
  std::tie(options.scene, options.motion) = GetParam();
  const test::TruthErrors errors = test::CompareTruthWithPictures(options, 40.0, 46.0);
  EXPECT_GT(errors.count, 80u);
  EXPECT_LT(errors.median_px, 0.035);
  EXPECT_LT(errors.p90_px, 0.08);
  EXPECT_LT(errors.bias_px, 0.01);
}

INSTANTIATE_TEST_SUITE_P(Renderer,
                         EveryScene,
                         testing::Combine(testing::ValuesIn(ValuesOf(kSceneNames)),
                                          testing::ValuesIn(ValuesOf(kMotionNames))),
                         [](const auto& info) {
                           return std::string(NameOf(kSceneNames, std::get<0>(info.param))) + "_" +
                                  std::string(NameOf(kMotionNames, std::get<1>(info.param)));
                         });

}  // namespace
}  // namespace cohort
