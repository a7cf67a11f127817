// The main job on rendered and, where it is there, on real input, as a user runs it: a clip goes
// in, tracks of the joint tracker and of plain KLT come out, COLMAP reconstructs both.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <tuple>

#include "backend/colmap/model_io.h"
#include "frontend/storage/input_file.h"
#include "frontend/tracks/track_store.h"
#include "tests/support/program.h"
#include "tests/support/shared_data.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

// results.json as (tracker, backend, metric) -> value; the backend is empty for figures of tracks.
using Figures = std::map<std::tuple<std::string, std::string, std::string>, double>;

Figures CompareThroughColmap(const std::string& clip,
                             const std::string& more,
                             const std::string& out) {
  const test::ProgramEnd end =
      test::RunCohort("compare " + clip + " --backends colmap --quiet --out " + out + " " + more);
  EXPECT_EQ(end.exit_code, 0) << end.err;
  Figures figures;
  std::ifstream file(out + "/results.json");
  const nlohmann::json results = nlohmann::json::parse(file);
  for (const auto& row : results.at("rows")) {
    if (!row.at("value").is_number()) continue;
    figures[{row.at("tracker"), row.at("backend"), row.at("metric")}] = row.at("value");
  }
  return figures;
}

// 12 frames of 400 x 300 px.
void RenderSmallClip(const std::string& clip) {
  ASSERT_EQ(test::RunCohort("synth " + clip +
                            " --frames 12 --width-px 400 --height-px 300 --focal-px 330")
                .exit_code,
            0);
}

class MainJob : public testing::TestWithParam<const char*> {};

TEST_P(MainJob, AtMediumTheCohortTracksBetterThanKltAndEveryFrameRegisters) {
  const test::TempDir dir;
  const std::string motion = GetParam();
  const std::string clip = dir / "clip";
  ASSERT_EQ(test::RunCohort("synth " + clip + " --frames 40 --motion " + motion).exit_code, 0);
  // As many as KLT can hold here: of more it keeps those alone that are easy.
  const Figures figures = CompareThroughColmap(
      clip, "--levels medium --features 400 --trackers klt,subspace", dir / "out");
  const auto of = [&](const char* tracker, const char* metric) {
    return figures.at({tracker, "", metric});
  };
  EXPECT_LT(of("subspace", "observed_error_median"), of("klt", "observed_error_median"));
  EXPECT_LT(of("subspace", "observed_error_p90"), of("klt", "observed_error_p90"));
  EXPECT_GT(of("subspace", "mean_track_length"), of("klt", "mean_track_length"));
  EXPECT_EQ(figures.at({"subspace", "colmap", "registered"}), 40.0);
  EXPECT_LT(figures.at({"subspace", "colmap", "ate"}), 0.02);
}

INSTANTIATE_TEST_SUITE_P(Rendered, MainJob, testing::Values("lateral", "forward", "orbit"));

// A rolling shutter bends every picture; it is found from the tracks, and the cameras are those of
// a global one.
TEST(MainJob, FindsTheRollingShutter) {
  const test::TempDir dir;
  const auto at = [&](const std::string& name) { return (dir / name).string(); };
  std::map<std::string, nlohmann::json> errors;
  const auto run = [&](const std::string& command) {
    const test::ProgramEnd end = test::RunCohort(command);
    ASSERT_EQ(end.exit_code, 0) << end.err;
  };
  const auto read = [](const std::string& path) {
    std::ifstream file(path);
    return nlohmann::json::parse(file);
  };
  run("synth " + at("clip") + " --frames 40 --motion lateral --readout 0.6");
  run("track " + at("clip") + " --out " + at("t.tracks"));
  const std::map<std::string, std::string> options{
      {"found", ""},
      {"ignored", " --no-ceres.estimate-readout"},
      {"colmap", " --backend colmap"},
      {"colmap_ignored", " --backend colmap --no-global-shutter"}};
  for (const auto& [name, more] : options) {
    run("reconstruct " + at("t.tracks") + " --out " + at(name) + more);
    run("evaluate " + at(name) + " --truth " + at("clip") + " --json " + at(name + ".json"));
    errors[name] = read(at(name + ".json"));
  }
  EXPECT_NEAR(read(at("found/summary.json")).at("readout"), 0.6, 0.015);
  EXPECT_LT(errors["found"].at("ate_m").get<double>(),
            0.2 * errors["ignored"].at("ate_m").get<double>());
  EXPECT_LT(errors["colmap"].at("ate_m").get<double>(),
            0.4 * errors["colmap_ignored"].at("ate_m").get<double>());
  EXPECT_LT(errors["found"].at("point_error_median_m").get<double>(),
            0.5 * errors["ignored"].at("point_error_median_m").get<double>());
}

// A phone stores its upright video as the sensor has it, and says how it is to be turned.
TEST(MainJob, FindsTheRollingShutterOfUprightVideo) {
  const test::TempDir dir;
  const auto at = [&](const std::string& name) { return (dir / name).string(); };
  ASSERT_EQ(test::RunCohort("synth " + at("clip") +
                            " --frames 40 --width-px 400 --height-px 300 --focal-px 330 "
                            "--motion lateral --readout 0.6 --quiet")
                .exit_code,
            0);
  test::RunShell("ffmpeg -loglevel error -framerate 30 -i " + at("clip/rgb/%06d.png") +
                 " -c:v libx264 -crf 8 -pix_fmt yuv420p " + at("flat.mp4"));
  test::RunShell("ffmpeg -loglevel error -i " + at("flat.mp4") +
                 " -c copy -metadata:s:v:0 rotate=90 " + at("upright.mp4"));
  for (const std::string& command :
       {"track " + at("upright.mp4") + " --features 300 --camera 330,330,149.5,199.5 --out " +
            at("t.tracks"),
        "reconstruct " + at("t.tracks") + " --out " + at("model")}) {
    const test::ProgramEnd end = test::RunCohort(command + " --quiet");
    ASSERT_EQ(end.exit_code, 0) << end.err;
  }
  std::ifstream file(at("model/summary.json"));
  const auto summary = nlohmann::json::parse(file);
  EXPECT_EQ(summary.at("row_order"), "right");  // FFmpeg turns against the clock
  EXPECT_NEAR(summary.at("readout"), 0.6, 0.05);
}

TEST(MainJob, ColmapsOwnFeaturesAreABaselineOfTheGrid) {
  const test::TempDir dir;
  const std::string clip = dir / "clip";
  RenderSmallClip(clip);
  const Figures figures =
      CompareThroughColmap(clip, "--trackers klt,sift --levels clean", dir / "out");
  EXPECT_EQ(figures.at({"sift", "colmap", "registered"}), 12.0);
  EXPECT_LT(figures.at({"sift", "colmap", "ate"}), 0.01);
  EXPECT_FALSE(figures.contains({"sift", "", "mean_track_length"}));  // it has no tracks
}

TEST(MainJob, WithAMaskNoTrackerOfTheGridHasAFeatureWhereItIsBlack) {
  constexpr int kLeft = 200;  // of 400 columns
  const test::TempDir dir;
  const std::string clip = dir / "clip";
  RenderSmallClip(clip);
  cv::Mat mask(300, 400, CV_8UC1, cv::Scalar(255));
  mask.colRange(0, kLeft).setTo(0);
  const std::string picture = dir / "mask.png";
  ASSERT_TRUE(cv::imwrite(picture, mask));
  CompareThroughColmap(clip, "--trackers klt,sift --mask " + picture, dir / "out");
  for (const std::string tracker : {"klt", "sift"}) {
    const Reconstruction model =
        FromColmapModel(ReadColmapModel(dir / "out/cells/clip/as-is/1/" / tracker / "colmap"));
    EXPECT_GT(model.points.size(), 20u) << tracker;
    for (const auto& [feature, point] : model.points) {
      // A feature begins in the light; KLT's may then move by some pixels.
      EXPECT_GT(point.views.front().xy.x(), kLeft - 1) << tracker;
    }
  }
  // Nor the ceiling, nor the points of the paper's protocol.
  const std::string more = " --levels medium --features 100 --mask " + picture + " --quiet --out ";
  const auto compare = [&](const std::string& arguments) {
    const test::ProgramEnd end = test::RunCohort("compare " + clip + arguments);
    ASSERT_EQ(end.exit_code, 0) << end.err;
  };
  compare(" --trackers ceiling --backends ceres" + more + (dir / "ceiling").string());
  const TrackSet ceiling =
      ReadTrackFile(dir / "ceiling/cells/clip/medium/1/ceiling/clip.tracks").tracks;
  EXPECT_GT(ceiling.features().size(), 20u);
  for (const FeatureId feature : ceiling.features()) {
    EXPECT_GT(ceiling.Track(feature).front().xy.x(), kLeft - 1);
  }
  mask.setTo(0);
  mask.at<uchar>(299, 399) = 255;
  ASSERT_TRUE(cv::imwrite(picture, mask));
  const test::ProgramEnd black = test::RunCohort(
      "compare " + clip + " --protocol paper --paper.window-frames 4 --trackers klt" + more +
      (dir / "paper").string());
  EXPECT_THAT(black.out + black.err, testing::HasSubstr("no corner of the first frame"));
}

TEST(MainJobOnRealFrames, RegistersAtLeast95PercentAsTheyAreAndDarkened) {
  const auto clip = test::SharedData("7scenes_redkitchen_000_299");
  COHORT_SKIP_WITHOUT(clip);
  // No two pictures of a camera in a hand are the same.
  if (ReadBytes(clip / "rgb/000001.jpg") == ReadBytes(clip / "rgb/000002.jpg")) {
    GTEST_SKIP() << clip.string() << " is damaged: two of its pictures are the same";
  }
  for (const std::string level : {"as-is", "medium"}) {
    const test::TempDir dir;
    const Figures figures = CompareThroughColmap(
        clip.string(), "--frames 0:60 --trackers subspace --levels " + level, dir / "out");
    EXPECT_GE(figures.at({"subspace", "colmap", "registered"}), 0.95 * 60) << level;
  }
}

// Fast motion ahead: 13 px a frame in the median, and no feature stays long.
TEST(MainJobOnRealFrames, FromACarIsHalfAsFarFromTheTruePathAsKlt) {
  const auto clip = test::SharedData("kitti_odo_seq1");
  COHORT_SKIP_WITHOUT(clip);
  const test::TempDir dir;
  const Figures figures =
      CompareThroughColmap(clip.string(), "--trackers klt,subspace --levels medium", dir / "out");
  EXPECT_EQ(figures.at({"subspace", "colmap", "registered"}), 51.0);
  EXPECT_LT(figures.at({"subspace", "colmap", "ate"}), 0.5 * figures.at({"klt", "colmap", "ate"}));
}

}  // namespace
}  // namespace cohort
