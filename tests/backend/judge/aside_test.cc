#include "backend/judge/aside.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace cohort {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr std::uint32_t kFrames = 60;

// What a stretch of frames shows: tracks of their own that move by so many px a frame.
struct Stretch {
  std::uint32_t end;
  int tracks;
  double px;
};

TrackFile ClipOf(const std::vector<Stretch>& stretches, std::vector<FrameIndex> cuts) {
  TrackFile file;
  file.width_px = 640;
  file.height_px = 480;
  file.meta.cuts = std::move(cuts);
  std::vector<Observation> observations;
  std::uint32_t first_id = 0;
  std::uint32_t frame = 0;
  for (const auto& [end, tracks, px] : stretches) {
    for (; frame < end; ++frame) {
      file.frames.push_back({FrameIndex{frame}, "", 0});
      for (int t = 0; t < tracks; ++t) {
        Observation o{FeatureId{first_id + static_cast<std::uint32_t>(t)}, FrameIndex{frame}};
        o.xy = {10.0 * t + px * frame, 100.0};
        observations.push_back(o);
      }
    }
    first_id += 1000;
  }
  file.tracks = TrackSet::Build(std::move(observations));
  return file;
}

// A model of frames first to end - 1, with a point of every track of the stretch with these ids.
Reconstruction ModelOf(std::uint32_t first, std::uint32_t end, std::uint32_t first_id) {
  Reconstruction model;
  for (std::uint32_t f = first; f < end; ++f) model.cam_from_world[FrameIndex{f}] = {};
  for (std::uint32_t t = 0; t < 40; ++t) model.points[FeatureId{first_id + t}] = {};
  return model;
}

Aside Frames(std::uint32_t first, std::uint32_t last, AsideKind kind) {
  return {FrameIndex{first}, FrameIndex{last}, kind};
}

TEST(FindAsides, ATitleCardBeforeACutIsNoPartOfTheScene) {
  const TrackFile file = ClipOf({{20, 30, 0.0}, {kFrames, 40, 3.0}}, {FrameIndex{20}});
  const Reconstruction model = ModelOf(20, kFrames, 1000);
  EXPECT_THAT(FindAsides(file, model), ElementsAre(Frames(0, 19, AsideKind::kCard)));
  const ReconstructionSummary summary = SummarizeModelOf(file, model);
  EXPECT_EQ(summary.frames, kFrames);
  EXPECT_EQ(summary.SceneFrames(), 40U);
  EXPECT_FALSE(TooFewRegistered(summary.registered, summary.SceneFrames()));
  EXPECT_THAT(summary.reasons, IsEmpty());
}

TEST(FindAsides, BlackFramesAndAFadeFromACard) {
  const TrackFile file =
      ClipOf({{5, 0, 0.0}, {20, 30, 0.0}, {28, 12, 1.0}, {kFrames, 40, 3.0}}, {});
  EXPECT_THAT(FindAsides(file, ModelOf(28, kFrames, 3000)),
              ElementsAre(Frames(0, 4, AsideKind::kBlank), Frames(5, 27, AsideKind::kCard)));
  const TrackFile black = ClipOf({{8, 2, 0.0}, {kFrames, 40, 3.0}}, {});
  EXPECT_THAT(FindAsides(black, ModelOf(8, kFrames, 1000)),
              ElementsAre(Frames(0, 7, AsideKind::kBlank)));
}

TEST(FindAsides, AnotherSceneAfterACut) {
  const TrackFile file = ClipOf({{40, 40, 3.0}, {kFrames, 40, 3.0}}, {FrameIndex{40}});
  EXPECT_THAT(FindAsides(file, ModelOf(0, 40, 0)),
              ElementsAre(Frames(40, 59, AsideKind::kOtherScene)));
}

// What the model lost of its own scene counts against it.
TEST(FindAsides, LostFramesOfTheSceneAreItsOwn) {
  const TrackFile moving = ClipOf({{kFrames, 40, 3.0}}, {});
  EXPECT_THAT(FindAsides(moving, ModelOf(20, kFrames, 0)), IsEmpty());
  // A camera that stands still before it begins to move sees the same points.
  TrackFile still = ClipOf({{20, 40, 0.0}, {kFrames, 40, 3.0}}, {});
  EXPECT_THAT(FindAsides(still, ModelOf(20, kFrames, 0)), IsEmpty());
  EXPECT_THAT(FindAsides(moving, {}), IsEmpty()) << "no model";
}

}  // namespace
}  // namespace cohort
