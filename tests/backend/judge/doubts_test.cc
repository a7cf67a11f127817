#include "backend/judge/doubts.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "backend/mapper/mapper.h"
#include "tests/support/synthetic_tracks.h"

namespace cohort {
namespace {

using test::CameraPath;
using testing::ElementsAre;
using testing::StartsWith;

TEST(Doubts, SaysThatPointsLieAlongALine) {
  const auto reconstruct = [](double height) {
    test::SyntheticTracksOptions options;
    options.path = CameraPath::kLateral;
    options.noise_px = 0.1;
    options.height = height;
    options.plane_relief = height;
    return ReconstructWithCeres(MakeSyntheticTracks(options).file);
  };
  const MapperResult line = reconstruct(0.03);
  EXPECT_LT(SpreadAcrossLine(line.reconstruction), 0.06);
  const std::vector<Doubt>& reasons = line.summary.reasons;
  const auto doubt = std::ranges::find(reasons, DoubtCode::kPointsOnALine, &Doubt::code);
  ASSERT_NE(doubt, reasons.end());
  EXPECT_THAT(doubt->sentence, StartsWith("the points lie along a line, about"));
  EXPECT_THAT(
      doubt->figures,
      ElementsAre(testing::Pair("spread_across_line", SpreadAcrossLine(line.reconstruction))));
  EXPECT_EQ(line.summary.Quality(), ModelQuality::kDoubtful);
  const MapperResult flat = reconstruct(0.5);
  EXPECT_GT(SpreadAcrossLine(flat.reconstruction), 0.2);
  EXPECT_EQ(flat.summary.Quality(), ModelQuality::kGood);
}

// A stretch before a blank wall, where few features may drift together.
TEST(Doubts, SaysThatFewPointsHoldAStretch) {
  const auto model = [](std::uint32_t points, std::uint32_t in_stretch) {
    Reconstruction made;
    for (std::uint32_t f = 0; f < 40; ++f) made.cam_from_world[FrameIndex{f}] = {};
    for (std::uint32_t i = 0; i < points; ++i) {
      for (std::uint32_t f = 0; f < 40; ++f) {
        if (f >= 10 && f < 14 && i >= in_stretch) continue;
        made.points[FeatureId{i}].views.push_back({FrameIndex{f}, {1.0, 1.0}});
      }
    }
    return made;
  };
  const auto doubt = DoubtFewPoints(model(170, 42));
  ASSERT_TRUE(doubt);
  EXPECT_EQ(doubt->code, DoubtCode::kFewPoints);
  EXPECT_THAT(doubt->sentence,
              StartsWith("4 frames, the first of them 10 and the last 13, are constrained by few "
                         "points (at least 42, compared with a median of 170), which may drift "));
  EXPECT_THAT(doubt->figures,
              ElementsAre(testing::Pair("frames", 4.0),
                          testing::Pair("points", 42.0),
                          testing::Pair("median_points", 170.0)));
  EXPECT_FALSE(DoubtFewPoints(model(170, 90))) << "enough";
  EXPECT_FALSE(DoubtFewPoints(model(50, 40))) << "as many as all frames have";
  EXPECT_FALSE(DoubtFewPoints(Reconstruction()));
}

// Half of all clips are off by more than is expected.
TEST(Doubts, DoubtsWhatMayBeOffByMoreThanAHundredthOfThePath) {
  EXPECT_FALSE(DoubtExpectedError(0.0049));
  const auto doubt = DoubtExpectedError(0.0051);
  ASSERT_TRUE(doubt);
  EXPECT_EQ(doubt->code, DoubtCode::kCamerasUncertain);
}

TEST(SpreadAcrossLine, IsThatOfTheViewsInTheirPictures) {
  Reconstruction model;
  // Twice as far along the diagonal as across, in a frame; in the other nothing to tell by.
  const std::vector<Eigen::Vector2d> seen{{8, 8}, {12, 12}, {9, 11}, {11, 9}};
  for (std::uint32_t i = 0; i < seen.size(); ++i) {
    model.points[FeatureId{i}].views = {{FrameIndex{3}, seen[i]}};
  }
  model.points[FeatureId{9}].views = {{FrameIndex{4}, {1, 1}}};
  EXPECT_NEAR(SpreadAcrossLine(model), 0.5, 1e-12);
  EXPECT_EQ(SpreadAcrossLine(Reconstruction()), 1.0);
}

}  // namespace
}  // namespace cohort
