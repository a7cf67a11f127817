// Files that COLMAP 4.2 wrote: tests/data/colmap_4.2/README.md.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <optional>

#include "backend/colmap/colmap_tracks.h"
#include "frontend/storage/sqlite.h"
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

// Opened for reading a database still gets files beside it, since its journal is a log: a copy.
ColmapDatabase ReadGolden(const char* name) {
  const test::TempDir dir;
  const fs::path path = dir / name;
  fs::copy_file(Golden(name), path);
  EXPECT_EQ(SqliteDatabase::Open(path, SqliteDatabase::Mode::kRead).UserVersion(), 4020100);
  return ReadColmapDatabase(path);
}

TEST(Colmap42Database, MigratedFromOursHasOurTracks) {
  const ColmapDatabase database = ReadGolden("migrated_from_3.8.db");
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

  const ImportedTracks imported = TracksOfColmapDatabase(database, Frames(), "a.db");
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

TEST(Colmap42Database, OfItsOwnFeaturesAndMatchesIsJoined) {
  const ColmapDatabase database = ReadGolden("database.db");
  EXPECT_EQ(database.images.size(), 12u);
  EXPECT_EQ(database.pairs.size(), 29u);
  for (const auto& [images, pair] : database.pairs) {
    ASSERT_TRUE(pair.geometry);
    EXPECT_TRUE(pair.geometry->fundamental);
    EXPECT_FALSE(pair.geometry->cam2_from_cam1) << "NULL, since nobody asked for it";
  }
  const ImportedTracks imported = TracksOfColmapDatabase(database, Frames(), "a.db");
  ExpectTheCamera(imported.camera.value());
  EXPECT_EQ(imported.left_out, 3u);
  EXPECT_EQ(imported.unknown_images, 0u);
  EXPECT_EQ(imported.tracks.features().size(), 61u);
  EXPECT_EQ(imported.tracks.observations().size(), 529u);
  // The camera moves slowly: a wrong join would jump through the picture of 160 px.
  for (const FeatureId feature : imported.tracks.features()) {
    const auto track = imported.tracks.Track(feature);
    for (std::size_t i = 1; i < track.size(); ++i) {
      EXPECT_LT((track[i].xy - track[i - 1].xy).norm(),
                4.0 * (ToInt(track[i].frame) - ToInt(track[i - 1].frame)));
    }
  }
}

class Colmap42Model : public testing::TestWithParam<const char*> {};

TEST_P(Colmap42Model, SeesOurPositions) {
  const ColmapModel model = ReadColmapModel(Golden(GetParam()));
  EXPECT_EQ(model.images.size(), 12u);
  const ImportedTracks imported = TracksOfColmapModel(model, Frames(), Golden(GetParam()));
  if (GetParam() == std::string("model_global")) {
    EXPECT_NEAR(imported.camera.value().fx, 131.0, 6.0);  // it refines the camera
  } else {
    ExpectTheCamera(imported.camera.value());
  }
  EXPECT_EQ(imported.tracks.frames().size(), 12u);
  EXPECT_EQ(imported.tracks.features().size(), 39u);
  EXPECT_EQ(imported.tracks.observations().size(), 447u);
  // All views of a point are of one track.
  const TrackSet ours = TracksOfTheFile();
  std::map<FeatureId, FeatureId> ours_of_point;
  for (const Observation& o : imported.tracks.observations()) {
    const auto all = ours.InFrame(o.frame);
    const auto nearest =
        *std::min_element(all.begin(), all.end(), [&](const Observation* a, const Observation* b) {
          return (a->xy - o.xy).norm() < (b->xy - o.xy).norm();
        });
    EXPECT_LT((nearest->xy - o.xy).norm(), 1e-4);
    EXPECT_EQ(ours_of_point.emplace(o.feature, nearest->feature).first->second, nearest->feature);
  }
}

INSTANTIATE_TEST_SUITE_P(Made,
                         Colmap42Model,
                         testing::Values("model_binary", "model_text", "model_global"),
                         [](const auto& info) { return std::string(info.param).substr(6); });

// Poses are the images', not the frames', of which newer models have a file, too.
TEST(Colmap42Models, TextAndBinaryAreTheSame) {
  const ColmapModel binary = ReadColmapModel(Golden("model_binary"));
  const ColmapModel text = ReadColmapModel(Golden("model_text"));
  ASSERT_EQ(binary.images.size(), text.images.size());
  for (const auto& [id, image] : binary.images) {
    const Rigid3& pose = text.images.at(id).cam_from_world;
    EXPECT_EQ(image.name, text.images.at(id).name);
    EXPECT_LT(AngleBetween(image.cam_from_world.rotation, pose.rotation), 1e-12);
    EXPECT_LT((image.cam_from_world.translation - pose.translation).norm(), 1e-12);
  }
  const auto moved =
      binary.images.at(1).cam_from_world * binary.images.at(12).cam_from_world.Inverse();
  EXPECT_GT(moved.translation.norm(), 1.0);
}

}  // namespace
}  // namespace cohort
