#include "backend/adjust/condensed_adjustment.h"

#include <gtest/gtest.h>

#include "backend/adjust/adjustment.h"
#include "tests/backend/scene/true_model.h"

namespace cohort {
namespace {

using test::AllFrames;
using test::CameraPath;
using test::MakeSyntheticTracks;
using test::SyntheticTracks;
using test::SyntheticTracksOptions;
using test::TrueModel;

SyntheticTracks LongTracks(CameraPath path, std::uint64_t seed = 1) {
  SyntheticTracksOptions options;
  options.path = path;
  options.frames = 120;
  options.points = 150;
  options.noise_px = 0.5;
  options.seed = seed;
  return MakeSyntheticTracks(options);
}

BundleOptions Rounds() {
  BundleOptions bundle;
  bundle.loss = RobustLoss::kCauchy;
  bundle.loss_scale = 3.0;
  bundle.max_iterations = 4;
  return bundle;
}

WorkingModel StartOf(const SyntheticTracks& scene, const WhitenedTracks& whitened) {
  WorkingModel model = TrueModel(scene, whitened, AllFrames(whitened));
  model.UpdateAllInliers(kInfinity);
  return model;
}

TEST(CondensedAdjustment, IsAsGoodAsTheCommonAdjustmentOfAllFrames) {
  for (const CameraPath path : {CameraPath::kArc, CameraPath::kLateral, CameraPath::kForward}) {
    const SyntheticTracks scene = LongTracks(path);
    const WhitenedTracks whitened(scene.file, {});
    WorkingModel condensed = StartOf(scene, whitened);
    const FrameRuns runs = ChooseRuns(condensed);
    EXPECT_TRUE(runs.Condense());
    for (int round = 0; round < 3; ++round) AdjustCondensed(condensed, runs, Rounds());
    WorkingModel common = StartOf(scene, whitened);
    common.Adjust(common.RegisteredFrames(), {}, MapperBundleOptions(common, {}, 12, 1e-8));
    EXPECT_LT(Ate(condensed, scene), 1.05 * Ate(common, scene));
    const std::vector<int> frames = AllFrames(whitened);
    EXPECT_LT(condensed.TruncatedCost(frames, 2.0), 1.005 * common.TruncatedCost(frames, 2.0));
  }
}

TEST(CondensedAdjustment, WithoutNoiseBringsMovedCamerasBack) {
  SyntheticTracksOptions options;
  options.frames = 60;
  options.noise_px = 0.0;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  const WhitenedTracks whitened(scene.file, {});
  WorkingModel model = StartOf(scene, whitened);
  for (const int frame : model.RegisteredFrames()) {
    Rigid3 pose = model.Pose(frame);
    pose.translation += 0.002 * Eigen::Vector3d(frame % 3 - 1, frame % 5 - 2, frame % 7 - 3);
    model.SetPose(frame, pose);
  }
  const double moved = Ate(model, scene);
  for (int round = 0; round < 4; ++round) AdjustCondensed(model, ChooseRuns(model), Rounds());
  EXPECT_LT(Ate(model, scene), 0.02 * moved);
}

// A camera that goes along 30 times as far as it sees at once.
TEST(CondensedAdjustment, TakesTheDriftOutOfALongPath) {
  SyntheticTracksOptions options;
  options.path = CameraPath::kLateral;
  options.frames = 600;
  options.path_length = 30.0;
  options.points = 4000;
  options.max_track_length = 40;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  const WhitenedTracks whitened(scene.file, {});
  WorkingModel model = StartOf(scene, whitened);
  for (const int frame : model.RegisteredFrames()) {
    Rigid3 pose = model.Pose(frame);
    pose.translation *= 1.0 + 1e-4 * frame;
    model.SetPose(frame, pose);
  }
  WorkingModel drifted(whitened, model);
  drifted.TriangulateAllTracks();
  drifted.UpdateAllInliers(kInfinity);
  const double before = Ate(drifted, scene);
  for (int round = 0; round < 3; ++round) AdjustCondensed(drifted, ChooseRuns(drifted), Rounds());
  EXPECT_LT(Ate(drifted, scene), 0.1 * before);
}

// Back and forth between the ends of an arc, ten times.
TEST(CondensedAdjustment, OfTracksThatNeverEndSomeRunsSpeakForAll) {
  SyntheticTracksOptions options;
  options.frames = 40;
  options.points = 60;
  const SyntheticTracks arc = MakeSyntheticTracks(options);
  TrackFile file = arc.file;
  std::vector<Observation> observations;
  file.frames.clear();
  for (std::uint32_t i = 0; i < 400; ++i) {
    const std::uint32_t of_arc = (i / 40) % 2 == 0 ? i % 40 : 39 - i % 40;
    FrameInfo frame = arc.file.frames[of_arc];
    frame.index = FrameIndex{i};
    file.frames.push_back(frame);
    for (const Observation* o : arc.file.tracks.InFrame(FrameIndex{of_arc})) {
      observations.push_back(*o);
      observations.back().frame = FrameIndex{i};
    }
  }
  file.tracks = TrackSet::Build(std::move(observations));
  const WhitenedTracks whitened(file, {});
  WorkingModel model(whitened, *file.camera);
  for (std::uint32_t i = 0; i < 400; ++i) {
    const std::uint32_t of_arc = (i / 40) % 2 == 0 ? i % 40 : 39 - i % 40;
    model.SetPose(static_cast<int>(i), arc.cam_from_world.at(FrameIndex{of_arc}));
  }
  model.TriangulateAllTracks();
  model.UpdateAllInliers(kInfinity);
  const FrameRuns runs = ChooseRuns(model);
  EXPECT_LE(runs.keyframes.size(), 70u);
  EXPECT_GE(runs.keyframes.size(), 50u);
  for (int frame = 0; frame < 400; ++frame) EXPECT_GE(runs.run_of_frame[frame], 0);
}

TEST(CondensedAdjustment, ShortTracksAreNotCondensed) {
  SyntheticTracksOptions options;
  options.path = CameraPath::kLateral;
  options.frames = 40;
  options.max_track_length = 8;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  const WhitenedTracks whitened(scene.file, {});
  EXPECT_FALSE(ChooseRuns(StartOf(scene, whitened)).Condense());
}

TEST(CondensedAdjustment, RunsCoverAllRegisteredFramesInOrder) {
  const SyntheticTracks scene = LongTracks(CameraPath::kLateral);
  const WhitenedTracks whitened(scene.file, {});
  const WorkingModel model = TrueModel(scene, whitened, {3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 40, 41});
  const FrameRuns runs = ChooseRuns(model);
  int last = 0;
  for (int frame = 0; frame < whitened.frame_count(); ++frame) {
    EXPECT_EQ(runs.run_of_frame[frame] >= 0, model.HasPose(frame));
    if (!model.HasPose(frame)) continue;
    EXPECT_GE(runs.run_of_frame[frame], last);
    last = runs.run_of_frame[frame];
  }
  for (std::size_t run = 0; run < runs.keyframes.size(); ++run) {
    EXPECT_EQ(runs.run_of_frame[runs.keyframes[run]], static_cast<int>(run));
  }
}

}  // namespace
}  // namespace cohort
