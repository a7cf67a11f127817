#include "pipelines/sfm/track_sequence.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>

#include "backend/colmap/model_io.h"
#include "frontend/storage/output.h"
#include "pipelines/sfm/reconstruct.h"
#include "tests/support/plane_clip.h"
#include "tests/support/synthetic_tracks.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

constexpr int kFrames = 16;

TrackSequenceOptions Klt(SecondPassMode second_pass) {
  TrackSequenceOptions options;
  options.tracker.tracker = TrackerKind::kKlt;
  options.tracker.detector.max_features = 100;
  options.second_pass.mode = second_pass;
  return options;
}

std::vector<std::pair<FeatureId, Eigen::Vector2d>> Positions(std::span<const Observation> tracks) {
  std::vector<std::pair<FeatureId, Eigen::Vector2d>> positions;
  for (const Observation& o : tracks) positions.emplace_back(o.feature, o.xy);
  return positions;
}

TEST(TrackSequence, GivesWhatGoingFrameByFrameGives) {
  test::PlaneClip clip(kFrames);
  const TrackSequenceOptions options = Klt(SecondPassMode::kOff);
  const TrackFile whole = TrackSequence(clip, options);
  EXPECT_EQ(whole.frames.size(), kFrames);
  EXPECT_GT(whole.tracks.features().size(), 50u);

  clip.Rewind();
  SequenceTracker tracker(clip, options);
  std::vector<Observation> observations;
  std::size_t ends = 0;
  while (tracker.HasNext()) {
    const FrameResult frame = tracker.TrackNext().result;
    observations.insert(observations.end(), frame.observations.begin(), frame.observations.end());
    ends += frame.ends.size();
  }
  EXPECT_EQ(Positions(TrackSet::Build(observations).observations()),
            Positions(whole.tracks.observations()));
  EXPECT_EQ(ends, whole.tracks.ends().size());
  EXPECT_EQ(tracker.Header().meta, whole.meta);
  EXPECT_EQ(tracker.Header().camera->fx, clip.scene().camera().fx);
}

TEST(TrackSequence, WithASecondPassTellsEveryStageAndWhatCameOfIt) {
  test::PlaneClip clip(kFrames);
  std::map<std::string, std::size_t> done;
  const TrackFile file = TrackSequence(
      clip,
      Klt(SecondPassMode::kOn),
      [&](std::string_view stage, std::size_t frames, std::optional<std::size_t> total) {
        done[std::string(stage)] = frames;
        EXPECT_EQ(total, kFrames);
      });
  EXPECT_TRUE(file.meta.second_pass);
  const std::map<std::string, std::size_t> all{
      {"learn", kFrames}, {"look", kFrames}, {"measure", kFrames}, {"track", kFrames}};
  EXPECT_EQ(done, all);
}

TEST(TrackSequence, WhatTheProgressThrowsEndsIt) {
  test::PlaneClip clip(4);
  const auto stop = [](std::string_view, std::size_t done, std::optional<std::size_t>) {
    if (done == 2) throw Error("enough");
  };
  EXPECT_THROW(TrackSequence(clip, Klt(SecondPassMode::kOff), stop), Error);
}

TEST(TrackSequence, AClipWithoutFramesIsAnError) {
  test::PlaneClip clip(0);
  EXPECT_THROW(TrackSequence(clip), Error);
}

TEST(Reconstruct, GivesTheCamerasOfAClipBackAndWritesThemIntoAFolder) {
  const test::TempDir dir;
  test::PlaneClip clip(kFrames);
  const TrackFile file = TrackSequence(clip, Klt(SecondPassMode::kOff));
  const ReconstructResult result = ReconstructIntoFolder(file, {}, dir / "model");
  EXPECT_FALSE(result.summary.Failed()) << result.summary.Brief();
  EXPECT_LT(
      test::AbsoluteTrajectoryError(result.reconstruction.cam_from_world, clip.TrueCamFromWorld()),
      0.01);
  EXPECT_EQ(ReadReconstruction(dir / "model").cam_from_world.size(), kFrames);
  const auto summary = nlohmann::json::parse(ReadBytes(dir / "model" / "summary.json"));
  EXPECT_EQ(summary["registered"], kFrames);
  EXPECT_EQ(summary["backend"], "ceres");
  EXPECT_EQ(summary["options"]["backend"], "ceres");
}

}  // namespace
}  // namespace cohort
