// Files that COLMAP 4.2 wrote: tests/data/colmap_4.2/README.md.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "backend/colmap/colmap_tracks.h"
#include "frontend/core/sqlite.h"
#include "frontend/tracks/track_csv.h"
#include "tests/support/source_dir.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

fs::path Golden(const char* name) { return test::SourceDir() / "tests/data/colmap_4.2" / name; }

std::vector<FrameInfo> Frames() {
  std::vector<FrameInfo> frames;
  for (std::uint32_t i = 0; i < 12; ++i) {
    frames.push_back({FrameIndex{i}, fmt::format("rgb/{:06}.png", i), 0});
  }
  return frames;
}

TrackSet TracksOfTheFile() { return ReadTracksCsv(Golden("tracks.csv")).tracks; }

void ExpectTheCamera(const Camera& camera) {
  EXPECT_EQ(camera.model, CameraModel::kPinhole);
  EXPECT_TRUE(camera.known);
  EXPECT_EQ(camera.width_px, 160);
  EXPECT_EQ(camera.height_px, 120);
  EXPECT_EQ(camera.fx, 131.0);
  EXPECT_EQ(camera.cx, 79.5);
  EXPECT_EQ(camera.cy, 59.5);
  EXPECT_FALSE(camera.HasDistortion());
}

class Database : public testing::TestWithParam<const char*> {};

TEST_P(Database, OfColmap42HasTheTracks) {
  // Opened for reading it still gets files beside it: its journal is a log.
  const test::TempDir dir;
  const fs::path path = dir / "a.db";
  fs::copy_file(Golden(GetParam()), path);
  EXPECT_EQ(SqliteDatabase::Open(path, SqliteDatabase::Mode::kRead).UserVersion(), 4020000);
  const ColmapDatabase database = ReadColmapDatabase(path);
  EXPECT_EQ(database.images.size(), 12u);
  std::size_t with_pose = 0;
  for (const auto& [images, pair] : database.pairs) {
    ASSERT_TRUE(pair.geometry);
    if (pair.geometry->config == ColmapPairConfig::kCalibrated) {
      EXPECT_TRUE(pair.geometry->essential);
      EXPECT_TRUE(pair.geometry->cam2_from_cam1);
      ++with_pose;
    }
  }
  EXPECT_EQ(with_pose, 5u);

  const ImportedTracks imported = TracksOfColmapDatabase(database, Frames(), path);
  ExpectTheCamera(imported.camera.value());
  EXPECT_EQ(imported.left_out, 0u);
  EXPECT_EQ(imported.unknown_images, 0u);
  EXPECT_EQ(imported.tracks.features().size(), 44u);
  EXPECT_EQ(imported.tracks.observations().size(), 466u);
  // Each is of one of ours: the same positions as 32-bit floats of COLMAP's pixels.
  const TrackSet ours = TracksOfTheFile();
  const auto in_colmap = [](const Observation& o) {
    return Eigen::Vector2f((o.xy.array() + 0.5).matrix().cast<float>());
  };
  for (const FeatureId feature : imported.tracks.features()) {
    const auto track = imported.tracks.Track(feature);
    std::optional<FeatureId> same;
    for (const Observation* o : ours.InFrame(track.front().frame)) {
      if (in_colmap(*o) == in_colmap(track.front())) same = o->feature;
    }
    ASSERT_TRUE(same);
    for (const Observation& o : track) {
      const Observation* before = ours.Find(*same, o.frame);
      ASSERT_NE(before, nullptr);
      EXPECT_EQ(in_colmap(*before), in_colmap(o));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Made, Database, testing::Values("database.db", "migrated_from_3.8.db"), [](const auto& info) {
      return std::string(info.param).starts_with("migrated") ? "MigratedByIt" : "ByIt";
    });

class Model : public testing::TestWithParam<const char*> {};

TEST_P(Model, OfColmap42HasTheTracks) {
  const ColmapModel model = ReadColmapModel(Golden(GetParam()));
  EXPECT_EQ(model.images.size(), 12u);
  EXPECT_EQ(model.points.size(), 52u);
  const ImportedTracks imported = TracksOfColmapModel(model, Frames(), Golden(GetParam()));
  ExpectTheCamera(imported.camera.value());
  EXPECT_EQ(imported.tracks.observations().size(), 555u);
  const TrackSet ours = TracksOfTheFile();
  for (const Observation& o : imported.tracks.observations()) {
    const Observation* before = ours.Find(o.feature, o.frame);
    ASSERT_NE(before, nullptr);
    EXPECT_LT((before->xy - o.xy).norm(), 1e-9);
  }
  // The path is 12 frames to the side; the poses are those of the images, not of the frames' file.
  EXPECT_EQ(model.images.at(1).cam_from_world.translation.norm(), 0.0);
  EXPECT_GT(model.images.at(12).cam_from_world.translation.norm(), 0.01);
}

INSTANTIATE_TEST_SUITE_P(In,
                         Model,
                         testing::Values("model_binary", "model_text"),
                         [](const auto& info) {
                           return std::string(info.param) == "model_text" ? "Text" : "Binary";
                         });

// What its global mapper made of the database: its points see keypoints of ours.
TEST(GlobalModel, OfColmap42SeesOurPositions) {
  const ColmapModel model = ReadColmapModel(Golden("model_global"));
  const ImportedTracks imported = TracksOfColmapModel(model, Frames(), "model_global");
  EXPECT_NEAR(imported.camera.value().fx, 131.0, 6.0);  // it refines the camera
  EXPECT_EQ(imported.tracks.frames().size(), 12u);
  EXPECT_EQ(imported.tracks.features().size(), 39u);
  EXPECT_EQ(imported.tracks.observations().size(), 447u);
  const TrackSet ours = TracksOfTheFile();
  for (const Observation& o : imported.tracks.observations()) {
    double nearest_px = 1e9;
    for (const Observation* before : ours.InFrame(o.frame)) {
      nearest_px = std::min(nearest_px, (before->xy - o.xy).norm());
    }
    EXPECT_LT(nearest_px, 1e-4);
  }
}

}  // namespace
}  // namespace cohort
