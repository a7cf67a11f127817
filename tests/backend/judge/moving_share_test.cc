#include "backend/judge/moving_share.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "backend/mapper/mapper.h"
#include "tests/backend/scene/true_model.h"

namespace cohort {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

// The first `share` of the features go down by 5 px a frame and jump back every five frames, whatever
// the camera does.
MapperResult ReconstructWithJumping(double share) {
  test::SyntheticTracks scene = test::LateralScene(0.1);
  const auto features = scene.file.tracks.features();
  const auto jumping = static_cast<std::size_t>(share * static_cast<double>(features.size()));
  std::vector<Observation> observations;
  for (std::size_t i = 0; i < features.size(); ++i) {
    for (Observation o : scene.file.tracks.Track(features[i])) {
      if (i < jumping) o.xy.y() += 5.0 * (ToInt(o.frame) % 5);
      observations.push_back(o);
    }
  }
  scene.file.tracks = TrackSet::Build(std::move(observations));
  return ReconstructWithCeres(scene.file);
}

TEST(MovingShare, AModelOfWhichMuchMovesIsDoubted) {
  const MapperResult result = ReconstructWithJumping(0.3);
  const auto doubt = std::find_if(result.summary.reasons.begin(),
                                  result.summary.reasons.end(),
                                  [](const Doubt& d) { return d.code == DoubtCode::kThingsMove; });
  ASSERT_NE(doubt, result.summary.reasons.end());
  EXPECT_THAT(doubt->sentence,
              HasSubstr(" % of the observations are on independently moving objects"));
  EXPECT_THAT(doubt->figures,
              ElementsAre(testing::Pair("moving_share", testing::DoubleNear(0.3, 0.03))));
}

TEST(MovingShare, AFewThingsThatMoveDoNotMakeAModelDoubtful) {
  EXPECT_EQ(ReconstructWithJumping(0.1).summary.Quality(), ModelQuality::kGood);
  EXPECT_EQ(ReconstructWithJumping(0.0).summary.Quality(), ModelQuality::kGood);
}

}  // namespace
}  // namespace cohort
