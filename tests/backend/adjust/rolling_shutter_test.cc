#include "backend/adjust/rolling_shutter.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <optional>
#include <string>
#include <vector>

#include "backend/mapper/mapper.h"
#include "frontend/core/random_stream.h"
#include "tests/backend/scene/true_model.h"

namespace cohort {
namespace {

using test::AllFrames;
using test::CameraPath;
using test::MakeSyntheticTracks;
using test::SyntheticTracks;
using test::SyntheticTracksOptions;
using test::TrueModel;

constexpr int kFrames = 30;

// A hand that carries a camera sideways, past the points of the synthetic scene.
Rigid3 PoseAt(double t) {
  const auto sway = [t](double size, double rate, double phase) {
    return size * std::sin(rate * t + phase);
  };
  const Eigen::Vector3d center(
      0.06 * t - 0.9 + sway(0.02, 0.7, 0.0), sway(0.03, 0.9, 1.0), sway(0.03, 0.6, 2.0));
  const Eigen::Quaterniond rotation =
      Eigen::AngleAxisd(sway(0.02, 0.8, 0.5), Eigen::Vector3d::UnitX()) *
      Eigen::AngleAxisd(sway(0.03, 0.5, 1.5), Eigen::Vector3d::UnitY()) *
      Eigen::AngleAxisd(sway(0.03, 1.0, 2.5), Eigen::Vector3d::UnitZ());
  return {rotation, -(rotation * center)};
}

// Points as a rolling shutter shows them to that hand, each row at its own time.
// Of some of the points, the `others`, with another readout.
SyntheticTracks Rolling(double readout,
                        std::uint64_t seed = 1,
                        double noise_px = 0.3,
                        std::size_t every = 0,
                        double others = 0.0) {
  SyntheticTracksOptions options;
  options.path = CameraPath::kLateral;
  options.points = 150;
  SyntheticTracks scene = MakeSyntheticTracks(options);
  const Camera& camera = *scene.file.camera;
  RandomStream noise(seed, "rolling_shutter_test");
  scene.file.frames.clear();
  scene.cam_from_world.clear();
  std::vector<Observation> observations;
  for (std::uint32_t frame = 0; frame < kFrames; ++frame) {
    FrameInfo& info = scene.file.frames.emplace_back();
    info.index = FrameIndex{frame};
    info.name = std::to_string(frame);
    scene.cam_from_world[info.index] = PoseAt(frame);
    std::size_t number = 0;
    for (const auto& [feature, point] : scene.points_in_world) {
      const double own = every > 0 && number++ % every == 0 ? others : readout;
      double y = 0.5 * camera.height_px;
      std::optional<Eigen::Vector2d> xy;
      for (int step = 0; step < 20; ++step) {
        xy = camera.Project(PoseAt(frame + own * ((y + 0.5) / camera.height_px - 0.5)) * point);
        if (!xy) break;
        y = xy->y();
      }
      const double dx = noise_px * noise.Gaussian();
      const double dy = noise_px * noise.Gaussian();
      if (!xy || !camera.Contains(*xy)) continue;
      Observation& o = observations.emplace_back();
      o.feature = feature;
      o.frame = info.index;
      o.xy = *xy + Eigen::Vector2d(dx, dy);
    }
  }
  scene.file.tracks = TrackSet::Build(std::move(observations));
  return scene;
}

double Ate(const MapperResult& result, const SyntheticTracks& scene) {
  return test::AbsoluteTrajectoryError(result.reconstruction.cam_from_world, scene.cam_from_world);
}

TEST(RollingShutter, ObservationsBecomeThoseOfAGlobalOne) {
  const SyntheticTracks rolling = Rolling(0.7, 1, 0.0);
  const SyntheticTracks global = Rolling(0.0, 1, 0.0);
  const WhitenedTracks wanted(global.file, {});
  const WorkingModel model = TrueModel(global, wanted, AllFrames(wanted));
  Reconstruction known;
  known.camera = *global.file.camera;
  known.readout = 0.7;
  known.cam_from_world = global.cam_from_world;
  for (const auto& [feature, point] : global.points_in_world)
    known.points[feature].in_world = point;
  const TrackFile corrected = AsGlobalShutter(rolling.file, known);
  double most_px = 0.0;
  double before_px = 0.0;
  for (const Observation& o : corrected.tracks.observations()) {
    const auto xy = known.camera.Project(known.cam_from_world.at(o.frame) *
                                         global.points_in_world.at(o.feature));
    if (o.frame < FrameIndex{2} || o.frame >= FrameIndex{kFrames - 2}) continue;
    most_px = std::max(most_px, (o.xy - *xy).norm());
    before_px =
        std::max(before_px, (rolling.file.tracks.Find(o.feature, o.frame)->xy - *xy).norm());
  }
  EXPECT_GT(before_px, 5.0);
  EXPECT_LT(most_px, 0.2);  // what the polynomial through four frames misses of the sway
}

TEST(RollingShutter, ReadoutIsFoundFromTheTracks) {
  for (const double readout : {0.7, -0.4}) {
    const SyntheticTracks scene = Rolling(readout);
    const MapperResult result = ReconstructWithCeres(scene.file);
    ASSERT_EQ(result.termination, MapperTermination::kSuccess) << result.summary.Brief();
    EXPECT_NEAR(result.reconstruction.readout / readout, 1.0, 0.05);
    MapperOptions ignored;
    ignored.estimate_readout = false;
    EXPECT_LT(Ate(result, scene), 0.2 * Ate(ReconstructWithCeres(scene.file, ignored), scene));
  }
}

// A phone's upright video: the picture is the sensor's, turned clockwise by a quarter.
TEST(RollingShutter, IsFoundInPicturesThatWereTurnedUpright) {
  SyntheticTracks scene = Rolling(0.7);
  const Camera sensor = *scene.file.camera;
  Camera& camera = *scene.file.camera;
  std::swap(camera.width_px, camera.height_px);
  camera.fx = sensor.fy;
  camera.fy = sensor.fx;
  camera.cx = sensor.height_px - 1.0 - sensor.cy;
  camera.cy = sensor.cx;
  ASSERT_FALSE(sensor.HasDistortion());
  std::swap(scene.file.width_px, scene.file.height_px);
  std::vector<Observation> observations(scene.file.tracks.observations().begin(),
                                        scene.file.tracks.observations().end());
  for (Observation& o : observations) o.xy = {sensor.height_px - 1.0 - o.xy.y(), o.xy.x()};
  scene.file.tracks = TrackSet::Build(std::move(observations));
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(0.5 * EIGEN_PI, Eigen::Vector3d::UnitZ()));
  for (auto& [frame, pose] : scene.cam_from_world) {
    pose = {turn * pose.rotation, turn * pose.translation};
  }
  const double not_said = Ate(ReconstructWithCeres(scene.file), scene);
  scene.file.meta.row_order = RowOrder::kLeft;
  const MapperResult result = ReconstructWithCeres(scene.file);
  EXPECT_NEAR(result.reconstruction.readout, 0.7, 0.05);
  EXPECT_EQ(result.reconstruction.camera.row_order, RowOrder::kLeft);
  EXPECT_LT(Ate(result, scene), 0.2 * not_said);
}

TEST(RollingShutter, IsFoundTogetherWithAGuessedFocalLength) {
  SyntheticTracks scene = Rolling(0.7);
  const double true_focal = scene.file.camera->fx;
  Camera guess = *scene.file.camera;
  guess.known = false;
  guess.fx = guess.fy = 1.25 * true_focal;
  scene.file.camera = guess;
  const MapperResult result = ReconstructWithCeres(scene.file);
  ASSERT_EQ(result.termination, MapperTermination::kSuccess) << result.summary.Brief();
  EXPECT_NEAR(result.reconstruction.readout, 0.7, 0.05);
  EXPECT_NEAR(result.reconstruction.camera.fx / true_focal, 1.0, 0.03);
}

TEST(RollingShutter, GivenOneIsTakenAndCostsLittleAccuracy) {
  MapperOptions given;
  given.estimate_readout = false;
  given.readout = 0.6;
  const SyntheticTracks rolling = Rolling(0.6);
  const MapperResult result = ReconstructWithCeres(rolling.file, given);
  EXPECT_EQ(result.reconstruction.readout, 0.6);
  const SyntheticTracks global = Rolling(0.0);
  EXPECT_LT(Ate(result, rolling), 1.7 * Ate(ReconstructWithCeres(global.file), global));
}

TEST(RollingShutter, GlobalOneIsFoundToBeNoneAndChangesNothing) {
  const SyntheticTracks scene = Rolling(0.0);
  const MapperResult result = ReconstructWithCeres(scene.file);
  MapperOptions global;
  global.estimate_readout = false;
  const MapperResult without = ReconstructWithCeres(scene.file, global);
  EXPECT_EQ(result.reconstruction.readout, 0.0);
  for (const auto& [frame, pose] : without.reconstruction.cam_from_world) {
    EXPECT_EQ(pose.translation, result.reconstruction.cam_from_world.at(frame).translation);
  }
}

// A quarter of the tracks asks for more than the others. With them the shutter seems to roll enough
// to count; once they are no inliers any more, it does not.
TEST(RollingShutter, WhatTurnsOutNotToRollLeavesTheModelAsItWas) {
  const SyntheticTracks scene = Rolling(0.25, 1, 0.2, 4, 0.8);
  const WhitenedTracks observed(scene.file, {});
  WorkingModel model = TrueModel(scene, observed, AllFrames(observed));
  WhitenedTracks corrected = observed;
  const ReadoutEstimate estimate = EstimateReadout(observed, model, corrected);
  EXPECT_NEAR(estimate.readout, 0.25, 0.01) << "of the inliers alone";
  EXPECT_FALSE(estimate.IsRolling());
  EXPECT_EQ(&model.whitened(), &observed);
  for (const int frame : AllFrames(observed)) {
    const Rigid3& was = scene.cam_from_world.at(observed.frames()[frame].index);
    EXPECT_EQ(model.Pose(frame).translation, was.translation);
  }
}

TEST(RollingShutter, RefinedToNoneTheEstimateStays) {
  const SyntheticTracks scene = Rolling(0.1);
  const WhitenedTracks observed(scene.file, {});
  WorkingModel model = TrueModel(scene, observed, AllFrames(observed));
  WhitenedTracks corrected = observed;
  EXPECT_EQ(RefineReadout(observed, {0.4, 0.01}, model, corrected), 0.4);
  EXPECT_EQ(RefineReadout(observed, {-0.4, 0.01}, model, corrected), -0.4);
}

// A camera that flies on evenly bends all pictures alike, which the scene's shape takes up.
TEST(RollingShutter, WhereTheTracksDoNotTellNothingIsFound) {
  for (const CameraPath path : {CameraPath::kArc, CameraPath::kLateral, CameraPath::kForward}) {
    SyntheticTracksOptions options;
    options.path = path;
    const MapperResult result = ReconstructWithCeres(MakeSyntheticTracks(options).file);
    EXPECT_EQ(result.reconstruction.readout, 0.0);
  }
}

TEST(RollingShutter, EstimateSaysHowSureItIs) {
  constexpr double kReadout = 0.5;
  std::vector<double> squares;
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    const SyntheticTracks scene = Rolling(kReadout, seed);
    const WhitenedTracks observed(scene.file, {});
    WorkingModel model = TrueModel(scene, observed, AllFrames(observed));
    AdjustUntilSettled(model, 3, 5);
    WhitenedTracks corrected(observed);
    const ReadoutEstimate estimate = EstimateReadout(observed, model, corrected);
    EXPECT_TRUE(estimate.IsRolling());
    squares.push_back(std::pow((estimate.readout - kReadout) / estimate.sigma, 2));
  }
  const double mean = std::accumulate(squares.begin(), squares.end(), 0.0) / 6.0;
  EXPECT_GT(mean, 0.1);
  EXPECT_LT(mean, 4.0);
}

TEST(RollingShutter, ReadoutsThatGlobalShuttersSeemToHaveDoNotCount) {
  EXPECT_TRUE((ReadoutEstimate{0.527, 0.065}.IsRolling()));    // a camera with 0.7, in 30 frames
  EXPECT_FALSE((ReadoutEstimate{0.742, 0.151}.IsRolling()));   // rendered, global
  EXPECT_FALSE((ReadoutEstimate{0.274, 0.0084}.IsRolling()));  // dragged by a phone's denoising
  EXPECT_FALSE((ReadoutEstimate{-0.367, 0.030}.IsRolling()));  // KLT's drift on a turned toy
  EXPECT_TRUE((ReadoutEstimate{-0.7, 0.01}.IsRolling()));      // held upside down
  EXPECT_FALSE((ReadoutEstimate{1.0, 0.065}.IsRolling()));     // no frame is read that long
}

}  // namespace
}  // namespace cohort
