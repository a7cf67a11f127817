// The real COLMAP behind `cohort reconstruct`.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "backend/colmap/model_io.h"
#include "tests/support/program.h"
#include "tests/support/synthetic_tracks.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

// Tracks of 12 frames, in a file.
class ReconstructWithColmapCommand : public testing::Test {
 protected:
  void SetUp() override {
    test::SyntheticTracksOptions options;
    options.frames = 12;
    scene = MakeSyntheticTracks(options);
    WriteTrackFile(path("a.tracks"), scene.file);
  }
  std::string path(const std::string& name) const { return dir / name; }

  test::TempDir dir;
  test::SyntheticTracks scene;
};

TEST_F(ReconstructWithColmapCommand, WritesTheModelFolderOfAClip) {
  const test::ProgramEnd end = test::RunCohort(
      "reconstruct " + path("a.tracks") + " --backend colmap --no-write-frames --quiet --seed 3" +
      " --out " + path("m") + " --json " + path("r.json"));
  ASSERT_EQ(end.exit_code, 0) << end.err;

  const Reconstruction model = ReadReconstruction(path("m"));
  EXPECT_EQ(model.cam_from_world.size(), 12u);
  EXPECT_LT(test::AbsoluteTrajectoryError(model.cam_from_world, scene.cam_from_world), 0.02);
  const auto figures = nlohmann::json::parse(ReadBytes(path("r.json")));
  EXPECT_EQ(figures["registered"], 12);
  EXPECT_EQ(figures["points"], model.points.size());
  EXPECT_EQ(figures["options"]["colmap"]["seed"], 3);
  EXPECT_THAT(figures["termination"].get<std::string>(),
              testing::MatchesRegex("COLMAP [^ ]+ done.*"));
  EXPECT_EQ(figures["quality"], "good");
  EXPECT_EQ(figures["reasons"], nlohmann::json::array());
  EXPECT_THAT(ReadBytes(path("m/colmap/colmap.log")), testing::HasSubstr("random_seed 3 "));
}

// COLMAP knows no reasons of its own.
TEST_F(ReconstructWithColmapCommand, HasTheReasonsToDoubtThatCeresHas) {
  const auto reasons_with = [&](const std::string& options) {
    EXPECT_EQ(test::RunCohort("reconstruct " + path("a.tracks") +
                              " --backend colmap --no-write-frames --quiet " + options + " --out " +
                              path("m"))
                  .exit_code,
              0);
    const auto summary = nlohmann::json::parse(ReadBytes(path("m/summary.json")));
    EXPECT_EQ(summary["quality"], "doubtful");
    return summary["reasons"];
  };
  const auto unjudged = reasons_with("--no-ceres-start --no-global-shutter");
  ASSERT_EQ(unjudged.size(), 1u);
  EXPECT_EQ(unjudged[0]["code"], "not-judged");

  scene.file.camera->fx *= 1.3;
  scene.file.camera->fy *= 1.3;
  WriteTrackFile(path("a.tracks"), scene.file);
  const auto contradicted = reasons_with("");
  ASSERT_FALSE(contradicted.empty());
  EXPECT_EQ(contradicted[0]["code"], "camera-contradicted");
  EXPECT_THAT(contradicted[0]["sentence"].get<std::string>(),
              testing::StartsWith(
                  "according to the model of Ceres from the same tracks: the tracks contradict"));
  EXPECT_NEAR(contradicted[0]["figures"]["given_fx"], scene.file.camera->fx, 1e-9);
}

// Which here is told of no pair of frames.
TEST_F(ReconstructWithColmapCommand, GoesOnFromTheModelOfCeresWhereTheMapperGetsStuck) {
  const auto reconstruct = [&](const std::string& more) {
    return test::RunCohort(
        "reconstruct " + path("a.tracks") + " --backend colmap --no-write-frames --quiet" +
        " --colmap.database.two-view.min-inliers 10000 " + more + " --out " + path("m"));
  };
  EXPECT_EQ(reconstruct("--no-ceres-start").exit_code, 1);
  const test::ProgramEnd end = reconstruct("");
  ASSERT_EQ(end.exit_code, 0) << end.out << end.err;
  const Reconstruction model = ReadReconstruction(path("m"));
  EXPECT_EQ(model.cam_from_world.size(), 12u);
  EXPECT_LT(test::AbsoluteTrajectoryError(model.cam_from_world, scene.cam_from_world), 0.02);
  const auto summary = nlohmann::json::parse(ReadBytes(path("m/summary.json")));
  EXPECT_THAT(summary["termination"].get<std::string>(),
              testing::HasSubstr("adjusted a given model"));
}

TEST_F(ReconstructWithColmapCommand, KeepsTheCameraThatCeresFoundOfAGuessedOne) {
  scene.file.camera.reset();
  WriteTrackFile(path("a.tracks"), scene.file);
  const auto camera_by = [&](const std::string& arguments) {
    const test::ProgramEnd end = test::RunCohort("reconstruct " + path("a.tracks") + " --quiet " +
                                                 arguments + " --out " + path("m"));
    EXPECT_EQ(end.exit_code, 0) << end.out << end.err;
    return ReadReconstruction(path("m")).camera;
  };
  const Camera ceres = camera_by("");
  const Camera kept = camera_by("--backend colmap --no-write-frames");
  EXPECT_DOUBLE_EQ(kept.fx, ceres.fx);
  EXPECT_DOUBLE_EQ(kept.fy, ceres.fy);
  EXPECT_DOUBLE_EQ(kept.k1, ceres.k1);
  EXPECT_DOUBLE_EQ(kept.k2, ceres.k2);
  EXPECT_NE(camera_by("--backend colmap --no-write-frames --no-ceres-start").fx, ceres.fx)
      << "COLMAP's own refinement";
}

}  // namespace
}  // namespace cohort
