#include <gtest/gtest.h>

#include <string>
#include <tuple>

#include "backend/mapper/mapper.h"
#include "tests/support/shared_data.h"
#include "tests/support/shared_tracks.h"

namespace cohort {
namespace {

TEST(RealTracks, HandHeldTracksReconstruct) {
  const auto folder = test::SharedData("opencv_sfm_tracks");
  COHORT_SKIP_WITHOUT(folder);
  for (const auto& [name, frames, camera] :
       {std::tuple("desktop_tracks.txt", 250u, Camera::Guess(1280, 720)),
        std::tuple("backyard_tracks.txt", 100u, Camera::Guess(800, 450))}) {
    const MapperResult result = ReconstructWithCeres(test::ReadTrackLines(folder / name, camera));
    EXPECT_EQ(result.termination, MapperTermination::kSuccess) << result.summary.Brief();
    EXPECT_GE(result.summary.registered, frames - 1);  // one sees a handful of points
    EXPECT_LT(result.summary.mean_reprojection_px, 1.0);
  }
}

TEST(RealTracks, TheHotelReconstructs) {
  const auto folder = test::SharedData("cmu_hotel");
  COHORT_SKIP_WITHOUT(folder);
  const MapperResult result =
      ReconstructWithCeres(test::ReadTrackTables(folder, Camera::Guess(512, 480)));
  EXPECT_EQ(result.termination, MapperTermination::kSuccess) << result.summary.Brief();
  EXPECT_EQ(result.summary.registered, 51u);
  EXPECT_GT(result.summary.points, 450u);
  EXPECT_LT(result.summary.mean_reprojection_px, 1.0);
}

}  // namespace
}  // namespace cohort
