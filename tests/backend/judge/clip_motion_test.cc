#include "backend/judge/clip_motion.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>

#include "tests/support/synthetic_tracks.h"

namespace cohort {
namespace {

using test::CameraPath;

test::SyntheticTracksOptions Drifting(CameraPath path) {
  test::SyntheticTracksOptions options;
  options.path = path;
  options.frames = 40;
  options.drift_px = 0.5;
  return options;
}

ClipMotion MotionByDirection(const TrackFile& file, const Camera& camera) {
  const WhitenedTracks whitened(file, {});
  const std::vector<int> keyframes = SelectKeyframes(whitened, camera);
  return ClassifyDrift(whitened, camera, RankPairs(whitened, camera, keyframes));
}

TEST(ClassifyDrift, ParallaxLiesAlongTheEpipolarLinesAndDriftDoesNot) {
  for (const auto& [path, motion] : {std::pair(CameraPath::kStatic, ClipMotion::kStatic),
                                     std::pair(CameraPath::kRotation, ClipMotion::kRotation),
                                     std::pair(CameraPath::kLateral, ClipMotion::kParallax),
                                     std::pair(CameraPath::kForward, ClipMotion::kParallax),
                                     std::pair(CameraPath::kArc, ClipMotion::kParallax)}) {
    const TrackFile file = MakeSyntheticTracks(Drifting(path)).file;
    EXPECT_EQ(MotionByDirection(file, *file.camera), motion) << static_cast<int>(path);
  }
}

TEST(TurnsByAnotherCamera, IsSaidOfARotationWhoseLensIsAnotherAndOfNoPath) {
  for (const auto& [path, turns] : {std::pair(CameraPath::kRotation, true),
                                    std::pair(CameraPath::kLateral, false),
                                    std::pair(CameraPath::kForward, false),
                                    std::pair(CameraPath::kArc, false)}) {
    test::SyntheticTracksOptions options;
    options.path = path;
    options.camera.k1 = -0.05;
    const TrackFile file = MakeSyntheticTracks(options).file;
    const WhitenedTracks whitened(file, {});
    Camera given = options.camera;
    given.k1 = 0.0;
    given.known = true;
    const std::vector<int> keyframes = SelectKeyframes(whitened, given, 2.0, 10);
    const auto widest = WidestPairsOf(whitened, RankPairs(whitened, given, keyframes));
    EXPECT_EQ(TurnsByAnotherCamera(widest, given, 0.1), turns) << static_cast<int>(path);
  }
}

// A drone on its legs whose motors run: its camera turns to and fro by 2 px. A camera that turns by
// 40 px has been turned.
TEST(ClassifyMotion, AShakingTripodIsStatic) {
  const Camera camera = test::SyntheticTracksOptions::DefaultCamera();
  for (const auto& [motion_px, motion] :
       {std::pair(2.0, ClipMotion::kStatic), std::pair(40.0, ClipMotion::kRotation)}) {
    WidestPairs widest{.pairs = {{}}, .motion_px = motion_px, .quantile = 0.5};
    const Eigen::AngleAxisd turn(motion_px / camera.fx, Eigen::Vector3d::UnitY());
    for (int i = 0; i < 60; ++i) {
      const Eigen::Vector2d xy(120.0 + 7.0 * i, 60.0 + 40.0 * (i % 9));
      const auto turned = camera.Project(turn * camera.Unproject(xy).homogeneous().eval());
      widest.pairs[0].emplace_back(xy, *turned);
    }
    EXPECT_EQ(ClassifyMotion(widest, camera, 0.1), motion) << motion_px;
  }
}

// A rotation explains how nearly all points move, if the focal length is long: 36 px on the wall,
// 50 px on the ball, which has a sixth of them.
TEST(ClassifyMotion, AWallWithABallBeforeItIsNoRotation) {
  Camera camera = test::SyntheticTracksOptions::DefaultCamera();
  WidestPairs widest{.pairs = {{}}, .motion_px = 36.0, .quantile = 0.5};
  const auto add = [&](const Eigen::Vector3d& point) {
    const auto a = camera.Project(point);
    const auto b = camera.Project(point - Eigen::Vector3d(0.575, 0.0, 0.0));
    if (a && b) widest.pairs.front().emplace_back(*a, *b);
  };
  for (int row = 0; row < 10; ++row) {
    for (int column = 0; column < 20; ++column) add({-2.0 + 0.2 * column, -1.35 + 0.3 * row, 8.0});
  }
  for (int row = 0; row < 5; ++row) {
    for (int column = 0; column < 8; ++column) add({0.1 * column, -0.2 + 0.1 * row, 5.75});
  }
  camera.known = false;
  EXPECT_EQ(ClassifyMotion(widest, camera, 0.2), ClipMotion::kRotation);
  widest.quantile = 0.9;
  EXPECT_EQ(ClassifyMotion(widest, camera, 0.2), ClipMotion::kParallax);
}

// As of a clip of 15 frames a second in a video of 60.
TEST(EstimateNoise, IsThatOfTheTracksWherePicturesAreRepeated) {
  test::SyntheticTracksOptions options;
  options.noise_px = 0.3;
  const TrackFile once = MakeSyntheticTracks(options).file;
  const double noise = EstimateNoise(WhitenedTracks(once, {}));
  EXPECT_NEAR(noise, 0.3, 0.1);
  for (const std::uint32_t times : {2U, 4U}) {
    TrackFile file = once;
    file.frames.clear();
    std::vector<Observation> observations;
    for (std::uint32_t i = 0; i < times; ++i) {
      for (Observation o : once.tracks.observations()) {
        o.frame = FrameIndex{times * ToInt(o.frame) + i};
        observations.push_back(o);
      }
    }
    for (std::uint32_t i = 0; i < times * once.frames.size(); ++i) {
      file.frames.push_back({FrameIndex{i}, std::to_string(i) + ".png", 0});
    }
    file.tracks = TrackSet::Build(std::move(observations));
    EXPECT_EQ(EstimateNoise(WhitenedTracks(file, {})), 0.0) << "nothing is known of it";
  }
}

TEST(ClassifyDrift, SaysNothingWithoutPairs) {
  const TrackFile file = MakeSyntheticTracks(Drifting(CameraPath::kStatic)).file;
  EXPECT_EQ(ClassifyDrift(WhitenedTracks(file, {}), *file.camera, {}), ClipMotion::kParallax);
}

}  // namespace
}  // namespace cohort
