#include "pipelines/sfm/second_pass.h"

#include <gtest/gtest.h>

#include "tests/support/synthetic_tracks.h"

namespace cohort {
namespace {

constexpr double kMaxErrorPx = 3.0;

class MovingPast : public testing::Test {
 protected:
  MovingPast() {
    test::SyntheticTracksOptions options;
    options.path = test::CameraPath::kLateral;
    scene_ = test::MakeSyntheticTracks(options);
    model_.camera = *scene_.file.camera;
    model_.cam_from_world = scene_.cam_from_world;
  }

  // One track through the first `frames` of the clip.
  template <typename Position>
  bool Moves(int frames, const Position& xy) const {
    std::vector<Observation> track;
    for (const auto& [frame, cam_from_world] : scene_.cam_from_world) {
      if (static_cast<int>(track.size()) == frames) break;
      Observation o;
      o.frame = frame;
      o.xy = xy(static_cast<double>(track.size()), cam_from_world);
      track.push_back(o);
    }
    return MovesOtherwise(track, model_, kMaxErrorPx);
  }

  test::SyntheticTracks scene_;
  Reconstruction model_;
};

TEST_F(MovingPast, PointsOfTheSceneDoNot) {
  for (const FeatureId feature : scene_.file.tracks.features()) {
    EXPECT_FALSE(MovesOtherwise(scene_.file.tracks.Track(feature), model_, kMaxErrorPx))
        << ToInt(feature);
  }
}

TEST_F(MovingPast, NeitherDoesWhatIsInfinitelyFar) {
  EXPECT_FALSE(Moves(20, [&](double, const Rigid3& cam_from_world) {
    const Rigid3& first = scene_.cam_from_world.begin()->second;
    const Eigen::Vector3d far_point = first.Inverse() * Eigen::Vector3d(0.0, 0.0, 1e7);
    return *model_.camera.Project(cam_from_world * far_point);
  }));
}

// Across the direction in which the camera moves: no depth explains it.
TEST_F(MovingPast, SomethingThatCrossesDoes) {
  const auto crossing = [](double i, const Rigid3&) {
    return Eigen::Vector2d(320.0, 60.0 + 12.0 * i);
  };
  EXPECT_TRUE(Moves(20, crossing));
  EXPECT_FALSE(Moves(6, crossing)) << "six frames are too few to say";
}

}  // namespace
}  // namespace cohort
