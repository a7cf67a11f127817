// What becomes of clips that have no model, or hardly one: both passes and the reconstruction.

#include "tests/support/hard_clips.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pipelines/sfm/cuts.h"
#include "pipelines/sfm/reconstruct.h"
#include "pipelines/sfm/track_sequence.h"
#include "tests/support/picture_clip.h"

namespace cohort {
namespace {

using testing::StartsWith;

Camera TrueCamera() {
  Camera camera;
  camera.width_px = test::kHardWidth;
  camera.height_px = test::kHardHeight;
  camera.fx = camera.fy = 150.0;
  camera.cx = 0.5 * (test::kHardWidth - 1);
  camera.cy = 0.5 * (test::kHardHeight - 1);
  return camera;
}

struct Outcome {
  TrackFile file;
  ReconstructResult result;
};

Outcome RunBothPasses(const test::Pictures& pictures, TrackerKind tracker) {
  test::PictureClip clip(pictures, TrueCamera());
  TrackSequenceOptions options;
  options.tracker.tracker = tracker;
  options.tracker.detector.max_features = 60;
  TrackFile file = TrackSequence(clip, options);
  ReconstructResult result = Reconstruct(file);
  return {std::move(file), std::move(result)};
}

void ExpectFinite(const Outcome& outcome) {
  for (const Observation& o : outcome.file.tracks.observations()) {
    EXPECT_TRUE(o.xy.allFinite());
    EXPECT_TRUE(!o.covariance || o.covariance->Matrix().allFinite());
  }
  const Reconstruction& model = outcome.result.reconstruction;
  for (const auto& [frame, pose] : model.cam_from_world) {
    EXPECT_TRUE(pose.translation.allFinite());
    EXPECT_TRUE(pose.rotation.coeffs().allFinite());
  }
  for (const auto& [feature, point] : model.points) EXPECT_TRUE(point.in_world.allFinite());
  EXPECT_TRUE(std::isfinite(outcome.result.summary.mean_reprojection_px));
  for (const auto& [frame, covariance] : outcome.result.ceres->camera_covariances) {
    EXPECT_TRUE(covariance.allFinite());
  }
}

struct Expected {
  std::string clip;
  std::string termination;  // how it begins
  std::string doubt = {};   // how the first one begins
};

class ModelOfHardClip : public testing::TestWithParam<Expected> {};

TEST_P(ModelOfHardClip, SaysHowItEndedInBothTrackers) {
  const auto& [clip, termination, doubt] = GetParam();
  const test::Pictures pictures = test::HardClips().at(clip)();
  for (const TrackerKind tracker : {TrackerKind::kSubspace, TrackerKind::kKlt}) {
    SCOPED_TRACE(NameOf(kTrackerNames, tracker));
    const Outcome outcome = RunBothPasses(pictures, tracker);
    ExpectFinite(outcome);
    const ReconstructionSummary& summary = outcome.result.summary;
    EXPECT_THAT(summary.termination, StartsWith(termination));
    EXPECT_EQ(summary.frames, pictures.size());
    const bool has_model = termination.starts_with("success");
    EXPECT_EQ(summary.registered, has_model ? pictures.size() : 0u);
    EXPECT_EQ(summary.Quality(),
              !has_model      ? ModelQuality::kFailed
              : doubt.empty() ? ModelQuality::kGood
                              : ModelQuality::kDoubtful)
        << summary.Brief() << (summary.reasons.empty() ? "" : "; " + summary.reasons[0].sentence);
    if (!doubt.empty() && !summary.reasons.empty()) {
      EXPECT_THAT(summary.reasons.front().sentence, StartsWith(doubt));
    }
    if (tracker == TrackerKind::kSubspace) {
      EXPECT_EQ(outcome.file.meta.second_pass, has_model);
      EXPECT_THAT(outcome.file.meta.no_second_pass,
                  StartsWith(has_model ? "" : "the tracks do not reconstruct"));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Of,
    ModelOfHardClip,
    testing::Values(Expected{"NoTexture", "too few tracks"},
                    Expected{"Black", "too few tracks"},
                    Expected{"White", "too few tracks"},
                    Expected{"NoiseAlone", "too few tracks"},
                    Expected{"NothingMoves", "static camera"},
                    Expected{"CameraThatTurns", "pure rotation"},
                    // In eight frames, 58 points hold the cameras to half a per cent.
                    Expected{"OnePlane", "success", "the cameras are"},
                    Expected{"FeaturesOnALine", "too few tracks"},
                    Expected{"FewerFeaturesThanTheRank", "too few tracks"},
                    // A plane that goes by, less far than a lens may bend.
                    Expected{"FramesDropped", "success", "a rotating camera"},
                    Expected{"FramesRepeated", "success", "the cameras are"},
                    Expected{"FramesOutOfOrder", "success", "the cameras are"},
                    Expected{"StillAtFirst", "success"}),
    [](const auto& info) { return info.param.clip; });

// Every tracker sees all frames in one light, so that the tracks do not break where it falls.
TEST(ModelOfHardClips, WhereTheLightFallsAtOnceIsWhole) {
  const test::Pictures pictures = test::HardClips().at("SuddenlyDarker")();
  for (const TrackerKind tracker : {TrackerKind::kSubspace, TrackerKind::kKlt}) {
    const Outcome outcome = RunBothPasses(pictures, tracker);
    EXPECT_EQ(outcome.result.summary.registered, pictures.size()) << NameOf(kTrackerNames, tracker);
  }
}

// The model is of one scene; no track, observed or predicted, in either pass, is of both.
TEST(ModelOfHardClips, NothingCrossesACut) {
  const test::Pictures pictures =
      test::Joined(test::PlaneOnlyClip(14), test::MovingClip(4000.0, 6));
  for (const TrackerKind tracker : {TrackerKind::kSubspace, TrackerKind::kKlt}) {
    const Outcome outcome = RunBothPasses(pictures, tracker);
    ExpectFinite(outcome);
    EXPECT_EQ(outcome.file.meta.cuts, std::vector<FrameIndex>{FrameIndex{14}});
    for (const FeatureId feature : outcome.file.tracks.features()) {
      const auto track = outcome.file.tracks.Track(feature);
      EXPECT_EQ(ToInt(track.front().frame) < 14, ToInt(track.back().frame) < 14);
    }
    EXPECT_EQ(outcome.result.summary.registered, 14u);
    EXPECT_FALSE(outcome.result.summary.Failed()) << "the other scene is not missing";
    EXPECT_EQ(outcome.result.summary.asides,
              (std::vector<Aside>{{FrameIndex{14}, FrameIndex{19}, AsideKind::kOtherScene}}));
  }
}

TEST(CutsText, NamesTheFirstFew) {
  std::vector<FrameIndex> cuts{FrameIndex{12}};
  EXPECT_EQ(CutsText(cuts), "frame 12");
  cuts.push_back(FrameIndex{57});
  EXPECT_EQ(CutsText(cuts), "frames 12 and 57");
  for (std::uint32_t frame = 60; frame < 66; ++frame) cuts.push_back(FrameIndex{frame});
  EXPECT_EQ(CutsText(cuts), "frames 12, 57, 60, 61, 62 and 3 more");
}

TEST(FramesOption, ReadsEveryStepthFrameAsBefore) {
  TrackFile file;
  EXPECT_EQ(FramesOption(file, FrameIndex{12}), "--frames 12:");
  EXPECT_EQ(FramesOption(file, FrameIndex{12}, FrameIndex{20}), "--frames 12:20");
  file.meta.frames = "2:300:5";
  EXPECT_EQ(FramesOption(file, FrameIndex{12}), "--frames 12:300:5");
  EXPECT_EQ(FramesOption(file, FrameIndex{12}, FrameIndex{20}), "--frames 12:20:5");
}

TEST(ModelOfHardClips, OneFrameAndTwoAreTooFewAndSaySo) {
  for (const int frames : {1, 2}) {
    for (const TrackerKind tracker : {TrackerKind::kSubspace, TrackerKind::kKlt}) {
      const Outcome outcome = RunBothPasses(test::MovingClip(0.0, frames), tracker);
      EXPECT_THAT(outcome.result.summary.termination, StartsWith("too few tracks: "));
      EXPECT_EQ(outcome.file.frames.size(), static_cast<std::size_t>(frames));
    }
  }
}

}  // namespace
}  // namespace cohort
