#include "backend/colmap/colmap_tracks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "backend/colmap/tracks_to_database.h"
#include "frontend/core/error.h"
#include "tests/support/synthetic_tracks.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using test::MakeSyntheticTracks;
using test::TempDir;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

using Index = std::uint32_t;
using Matches = std::vector<ColmapMatch>;

std::vector<FrameInfo> Frames(Index count) {
  std::vector<FrameInfo> frames;
  for (Index i = 0; i < count; ++i) {
    frames.push_back({FrameIndex{i}, fmt::format("{}.png", i), 0});
  }
  return frames;
}

// Images 1, 2 ... of so many keypoints each, keypoint k of image i at (10 k + 1/2, i + 1/2).
ColmapDatabase Database(Index images, Index keypoints) {
  ColmapDatabase database;
  database.camera = ToColmapCamera(test::SyntheticTracksOptions::DefaultCamera());
  for (Index i = 1; i <= images; ++i) {
    ColmapImage& image = database.images[i];
    image.name = fmt::format("{}.png", i - 1);
    for (Index k = 0; k < keypoints; ++k) {
      image.keypoints.emplace_back(10.0F * static_cast<float>(k) + 0.5F,
                                   static_cast<float>(i) + 0.5F);
    }
  }
  return database;
}

void Match(ColmapDatabase& database, Index image1, Index image2, const Matches& inliers) {
  ColmapPair& pair = database.pairs[{image1, image2}];
  pair.matches = inliers;
  pair.geometry.emplace();
  pair.geometry->config = ColmapPairConfig::kCalibrated;
  pair.geometry->inliers = inliers;
}

ImportedTracks Tracks(const ColmapDatabase& database, Index frames = 4) {
  return TracksOfColmapDatabase(database, Frames(frames), "a.db");
}

// Of each track: frame and keypoint.
std::vector<std::vector<std::pair<Index, Index>>> Shape(const TrackSet& tracks) {
  std::vector<std::vector<std::pair<Index, Index>>> shape;
  for (const FeatureId feature : tracks.features()) {
    auto& track = shape.emplace_back();
    for (const Observation& o : tracks.Track(feature)) {
      track.emplace_back(ToInt(o.frame), static_cast<Index>(std::lround(o.xy.x() / 10.0)));
      EXPECT_EQ(o.xy.y(), ToInt(o.frame) + 1.0);
      EXPECT_TRUE(IsObserved(o));
    }
  }
  return shape;
}

using Track = std::vector<std::pair<Index, Index>>;

TEST(ColmapTracks, JoinsVerifiedMatchesIntoOneTrackAPoint) {
  ColmapDatabase database = Database(4, 3);
  Match(database, 1, 2, {{0, 1}, {2, 2}});
  Match(database, 2, 4, {{1, 0}});
  Match(database, 1, 4, {{0, 0}});
  database.pairs[{2, 3}].matches = {{0, 0}};  // not verified
  const ImportedTracks imported = Tracks(database);
  EXPECT_EQ(Shape(imported.tracks),
            (std::vector<Track>{{{0, 0}, {1, 1}, {3, 0}}, {{0, 2}, {1, 2}}}));
  EXPECT_EQ(imported.left_out, 0u);
  ASSERT_TRUE(imported.camera);
  EXPECT_EQ(imported.camera->fx, 500.0);
  EXPECT_EQ(imported.camera->cx, test::SyntheticTracksOptions::DefaultCamera().cx);
}

// COLMAP takes one of EXIF for known, too, and refines it: that it is one, nobody has measured.
TEST(ColmapTracks, ACameraOfOneFocalLengthIsAGuess) {
  ColmapDatabase database = Database(2, 1);
  Match(database, 1, 2, {{0, 0}});
  EXPECT_TRUE(Tracks(database).camera->known);
  database.camera.model = ColmapCameraModel::kSimpleRadial;
  database.camera.params = {500.0, 320.0, 240.0, 0.0};
  ASSERT_TRUE(database.camera.prior_focal_length);
  EXPECT_FALSE(Tracks(database).camera->known);
  EXPECT_EQ(Tracks(database).camera->fx, 500.0);
}

TEST(ColmapTracks, ACameraAsColmapStartsIsAGuess) {
  ColmapDatabase database = Database(2, 1);
  Match(database, 1, 2, {{0, 0}});
  ColmapCamera& camera = database.camera;
  camera.model = ColmapCameraModel::kOpencv;
  const std::vector<double> start = {
      500.0, 500.0, camera.width_px / 2.0, camera.height_px / 2.0, 0.0, 0.0, 0.0, 0.0};
  camera.params = start;
  EXPECT_FALSE(Tracks(database).camera->known);
  for (std::size_t i = 0; i < start.size(); ++i) {
    camera.params = start;
    camera.params[i] += 1e-3;
    EXPECT_TRUE(Tracks(database).camera->known) << "a measured parameter " << i;
  }
}

TEST(ColmapTracks, AFalseMatchNeitherJoinsTwoTracksNorCostsThem) {
  // Two points through four images; the pair of most inliers is right, the one of fewest wrong.
  ColmapDatabase database = Database(4, 3);
  Match(database, 1, 2, {{0, 0}, {1, 1}});
  Match(database, 2, 3, {{0, 0}, {1, 1}});
  Match(database, 3, 4, {{0, 0}, {1, 1}});
  Match(database, 1, 4, {{0, 1}});
  const ImportedTracks imported = Tracks(database);
  EXPECT_EQ(
      Shape(imported.tracks),
      (std::vector<Track>{{{0, 0}, {1, 0}, {2, 0}, {3, 0}}, {{0, 1}, {1, 1}, {2, 1}, {3, 1}}}));
  EXPECT_EQ(imported.left_out, 1u);
}

TEST(ColmapTracks, KeypointsAtOnePositionAreOne) {
  ColmapDatabase database = Database(3, 3);
  database.images[2].keypoints[1] = database.images[2].keypoints[0];
  Match(database, 1, 2, {{0, 0}});
  Match(database, 2, 3, {{1, 2}});
  const ImportedTracks imported = Tracks(database);
  EXPECT_EQ(Shape(imported.tracks), (std::vector<Track>{{{0, 0}, {1, 0}, {2, 2}}}));
}

TEST(ColmapTracks, AKeypointMatchedTwiceTakesTheFirst) {
  ColmapDatabase database = Database(2, 3);
  Match(database, 1, 2, {{0, 0}, {0, 1}});
  const ImportedTracks imported = Tracks(database);
  EXPECT_EQ(Shape(imported.tracks), (std::vector<Track>{{{0, 0}, {1, 0}}}));
  EXPECT_EQ(imported.left_out, 1u);
}

TEST(ColmapTracks, ImagesThatAreNoFrameAreCounted) {
  ColmapDatabase database = Database(4, 1);
  Match(database, 1, 2, {{0, 0}});
  Match(database, 2, 3, {{0, 0}});
  Match(database, 3, 4, {{0, 0}});
  const ImportedTracks imported = Tracks(database, 3);
  EXPECT_EQ(imported.unknown_images, 1u);
  EXPECT_EQ(imported.an_unknown_image, "3.png");
  EXPECT_EQ(imported.tracks.observations().size(), 3u);
  EXPECT_THAT([&] { Tracks(database, 0); },
              ThrowsMessage<Error>(HasSubstr("none of its 4 images")));
  database.images[2].name = "left/0.png";
  EXPECT_THAT(
      [&] { Tracks(database); },
      ThrowsMessage<Error>(AllOf(HasSubstr("left/0.png"), HasSubstr("both match frame 0"))));
}

TEST(ColmapTracks, WithoutVerifiedMatchesOrWithAPositionThatIsNoneThereAreNone) {
  ColmapDatabase database = Database(2, 1);
  database.pairs[{1, 2}].matches = {{0, 0}};
  EXPECT_THAT([&] { Tracks(database); },
              ThrowsMessage<Error>(AllOf(HasSubstr("a.db"), HasSubstr("no verified matches"))));
  Match(database, 1, 2, {{0, 0}});
  database.images[2].keypoints[0].x() = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT([&] { Tracks(database); },
              ThrowsMessage<Error>(HasSubstr("keypoint 0 of image 1.png is not finite")));
}

TEST(ColmapTracks, WhatWeExportComesBackToTheLastBitOfAFloat) {
  const TempDir dir;
  const TrackFile file = MakeSyntheticTracks({.points = 200}).file;
  WriteColmapDatabase(dir / "a.db", file);
  const TrackSet back =
      TracksOfColmapDatabase(ReadColmapDatabase(dir / "a.db"), file.frames, dir / "a.db").tracks;
  // Tracks are numbered anew: by the position in their first frame.
  std::map<std::pair<float, float>, FeatureId> feature_at;
  const auto key = [](const Observation& o) {
    const Eigen::Vector2f xy = (o.xy.array() + 0.5).matrix().cast<float>();
    return std::pair(xy.x(), xy.y());
  };
  std::size_t same = 0;
  for (const Observation& o : file.tracks.observations()) feature_at[key(o)] = o.feature;
  for (const FeatureId feature : back.features()) {
    const auto track = back.Track(feature);
    const auto was = file.tracks.Track(feature_at.at(key(track.front())));
    for (const Observation& o : track) {
      const Observation* before = file.tracks.Find(was.front().feature, o.frame);
      ASSERT_NE(before, nullptr);
      EXPECT_EQ(key(o), key(*before));
      ++same;
    }
  }
  EXPECT_GT(same, file.tracks.observations().size() * 98 / 100);
}

// Two points in three images, keypoints of image i at (10 k + 1/2, i + 1/2).
ColmapModel Model() {
  ColmapModel model;
  model.cameras[3] = ToColmapCamera(test::SyntheticTracksOptions::DefaultCamera());
  for (Index i = 1; i <= 3; ++i) {
    ColmapModelImage& image = model.images[i];
    image.camera_id = 3;
    image.name = fmt::format("{}.png", i - 1);
    for (int k = 0; k < 3; ++k) image.points2d.push_back({{10.0 * k + 0.5, i + 0.5}, std::nullopt});
  }
  model.points[8].track = {{1, 0}, {2, 1}};
  model.points[5].track = {{1, 2}, {3, 2}};
  return model;
}

ImportedTracks Tracks(const ColmapModel& model) {
  return TracksOfColmapModel(model, Frames(4), "model");
}

TEST(ColmapModelTracks, AreThoseOfItsPoints) {
  const ImportedTracks imported = Tracks(Model());
  EXPECT_THAT(imported.tracks.features(), testing::ElementsAre(FeatureId{4}, FeatureId{7}));
  EXPECT_EQ(Shape(imported.tracks), (std::vector<Track>{{{0, 2}, {2, 2}}, {{0, 0}, {1, 1}}}));
  ASSERT_TRUE(imported.camera);
  EXPECT_TRUE(imported.camera->known);
  EXPECT_EQ(imported.camera->cx, test::SyntheticTracksOptions::DefaultCamera().cx);
}

TEST(ColmapModelTracks, IdsOf64BitsAreCountedThrough) {
  ColmapModel model = Model();
  model.points[std::uint64_t{1} << 40].track = {{2, 0}, {3, 0}};
  EXPECT_THAT(Tracks(model).tracks.features(),
              testing::ElementsAre(FeatureId{0}, FeatureId{1}, FeatureId{2}));
  model = Model();
  model.points[0].track = {{2, 0}, {3, 0}};
  EXPECT_EQ(Tracks(model).tracks.features().size(), 3u);
}

TEST(ColmapModelTracks, PointsThatNoImageSeesAreNoTracks) {
  ColmapModel model = Model();
  for (auto& [id, point] : model.points) point.track.clear();
  EXPECT_THAT([&] { Tracks(model); },
              ThrowsMessage<Error>(HasSubstr("none of its 2 points is observed in an image")));
}

TEST(ColmapModelTracks, APointTwiceInAnImageKeepsTheFirst) {
  ColmapModel model = Model();
  model.points[8].track.emplace_back(1, 1);
  const ImportedTracks imported = Tracks(model);
  EXPECT_EQ(imported.left_out, 1u);
  EXPECT_EQ(imported.tracks.Find(FeatureId{7}, FrameIndex{0})->xy.x(), 0.0);
}

TEST(ColmapModelTracks, CamerasThatAreAlikeAreOneAndOthersAnError) {
  ColmapModel model = Model();
  model.cameras[4] = model.cameras[3];
  model.images[2].camera_id = 4;
  EXPECT_EQ(Tracks(model).tracks.features().size(), 2u);
  model.cameras[4].params[0] += 1.0;
  EXPECT_THAT([&] { Tracks(model); },
              ThrowsMessage<Error>(
                  AllOf(HasSubstr("model"), HasSubstr("the camera of image 1.png differs"))));
}

TEST(ColmapModelTracks, ACameraThatZoomsIsAGuessOfItsMedianFocalLength) {
  ColmapModel model = Model();
  const double focal_px = model.cameras.at(3).params[0];
  for (const auto& [id, scale] : {std::pair{1U, 1.5}, {2U, 1.2}, {3U, 0.8}}) {
    model.cameras[id] = model.cameras.at(3);
    for (double& focal : std::span(model.cameras[id].params).first(2)) focal = scale * focal_px;
    model.images[id].camera_id = id;
  }
  const ImportedTracks imported = Tracks(model);
  EXPECT_EQ(imported.camera->fx, 1.2 * focal_px);
  EXPECT_FALSE(imported.camera->known);
}

TEST(ColmapModelTracks, SaysInOneLineWhatIsNotThere) {
  const auto fails = [](const auto& change, const char* why) {
    ColmapModel model = Model();
    change(model);
    EXPECT_THAT([&] { Tracks(model); },
                ThrowsMessage<Error>(AllOf(HasSubstr("model"), HasSubstr(why))));
  };
  fails([](ColmapModel& m) { m.points[8].track.emplace_back(9, 0); }, "image 9");
  fails([](ColmapModel& m) { m.points[8].track.emplace_back(3, 3); }, "index 3");
  fails([](ColmapModel& m) { m.points.clear(); }, "0 points");
  fails([](ColmapModel& m) { m.images[1].camera_id = 9; }, "camera 9, which does not exist");
  fails(
      [](ColmapModel& m) {
        m.images[1].points2d[0].xy.x() = std::numeric_limits<double>::infinity();
      },
      "not finite");
  fails([](ColmapModel& m) { m.images.clear(); }, "0 images");
}

}  // namespace
}  // namespace cohort
