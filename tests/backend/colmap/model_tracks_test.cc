#include "backend/colmap/model_tracks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "backend/colmap/camera_model.h"
#include "frontend/core/error.h"
#include "tests/support/synthetic_tracks.h"

namespace cohort {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Key;
using testing::ThrowsMessage;

std::vector<FrameInfo> Frames(std::uint32_t count) {
  std::vector<FrameInfo> frames;
  for (std::uint32_t i = 0; i < count; ++i) {
    frames.push_back({FrameIndex{i}, fmt::format("{}.png", i), 100 + i});
  }
  return frames;
}

// Images 11, 12 and 13 are frames 3, 1 and 0 of the clip; two points.
ColmapModel Model() {
  ColmapModel model;
  model.cameras[3] = ToColmapCamera(test::SyntheticTracksOptions::DefaultCamera());
  const char* names[] = {"images/3.png", "images/1.png", "images/0.png"};
  for (std::uint32_t i = 0; i < 3; ++i) {
    ColmapModelImage& image = model.images[11 + i];
    image.camera_id = 3;
    image.name = names[i];
    image.cam_from_world.translation.x() = i;
    image.points2d = {{{50.5 + i, 60.5}, 8}, {{1.0, 2.0}, std::nullopt}, {{70.5, 80.5 + i}, 5}};
  }
  model.points[8] = {{1.0, 2.0, 9.0}, {10, 20, 30}, 0.0, {{11, 0}, {12, 0}}};
  model.points[5] = {{2.0, 1.0, 7.0}, {40, 50, 60}, 0.0, {{12, 2}, {13, 2}}};
  return model;
}

TEST(ModelOfClip, TracksAndReconstructionBelongTogether) {
  const ModelOfClip clip = ReadModelOfClip(Model(), Frames(5), "model");
  EXPECT_THAT(clip.file.tracks.features(), ElementsAre(FeatureId{4}, FeatureId{7}));
  EXPECT_THAT(clip.reconstruction.points, ElementsAre(Key(FeatureId{4}), Key(FeatureId{7})));
  const FrameIndex one{1};
  EXPECT_THAT(clip.reconstruction.cam_from_world,
              ElementsAre(Key(FrameIndex{0}), Key(one), Key(FrameIndex{3})));
  ASSERT_EQ(clip.file.frames.size(), 3u) << "frames without an image are left out";
  EXPECT_EQ(clip.file.frames[2].name, "3.png");
  EXPECT_EQ(clip.reconstruction.timestamps_ns.at(FrameIndex{3}), 103);
  EXPECT_EQ(clip.reconstruction.cam_from_world.at(one).translation.x(), 1.0);
  EXPECT_EQ(clip.reconstruction.points.at(FeatureId{7}).in_world.z(), 9.0);
  // COLMAP's pixels begin half a pixel earlier.
  EXPECT_EQ(clip.file.tracks.Find(FeatureId{7}, one)->xy, Eigen::Vector2d(51.0, 60.0));
  EXPECT_EQ(clip.reconstruction.points.at(FeatureId{7}).views[0].xy, Eigen::Vector2d(51.0, 60.0));
  EXPECT_EQ(clip.file.width_px, clip.file.camera->width_px);
}

TEST(ModelOfClip, ComesBackAsTheSameModel) {
  const ColmapModel model = Model();
  const ModelOfClip clip = ReadModelOfClip(model, Frames(5), "model");
  Reconstruction moved = clip.reconstruction;
  moved.cam_from_world.at(FrameIndex{3}).translation.y() = 5.0;
  moved.points.at(FeatureId{4}).in_world.x() = 6.0;
  const ColmapModel back = ReplaceInModel(model, clip, moved, false);
  EXPECT_EQ(back.cameras, model.cameras);
  EXPECT_THAT(back.images, ElementsAre(Key(11u), Key(12u), Key(13u)));
  for (const auto& [id, image] : back.images) {
    EXPECT_EQ(image.name, model.images.at(id).name);
    EXPECT_EQ(image.camera_id, 3u);
  }
  EXPECT_EQ(back.images.at(11).cam_from_world.translation.y(), 5.0);
  EXPECT_THAT(back.points, ElementsAre(Key(5u), Key(8u)));
  EXPECT_EQ(back.points.at(5).xyz.x(), 6.0);
  for (const auto& [id, point] : back.points) {
    EXPECT_EQ(point.rgb, model.points.at(id).rgb);
    ASSERT_EQ(point.track.size(), 2u);
    for (const auto& [image, index] : point.track) {
      EXPECT_EQ(back.images.at(image).points2d.at(index).point3d, id);
    }
  }
  EXPECT_EQ(back.images.at(12).points2d.size(), 2u) << "keypoints of no point are left out";
  const auto [image, index] = back.points.at(8).track[0];
  EXPECT_EQ(back.images.at(image).points2d.at(index).xy.y(), 60.5);
}

TEST(ModelOfClip, ARefinedCameraReplacesAll) {
  ColmapModel model = Model();
  model.cameras[4] = model.cameras[3];
  model.images[12].camera_id = 4;
  const ModelOfClip clip = ReadModelOfClip(model, Frames(5), "model");
  Reconstruction other = clip.reconstruction;
  other.camera.fx = other.camera.fy = 500.0;
  const ColmapModel back = ReplaceInModel(model, clip, other, true);
  EXPECT_THAT(back.cameras, ElementsAre(Key(3u), Key(4u)));
  EXPECT_EQ(back.cameras.at(4).params[0], 500.0);
  EXPECT_EQ(back.cameras.at(3), back.cameras.at(4));
}

TEST(ModelOfClip, AZoomComesBack) {
  ColmapModel model = Model();
  for (auto& [id, image] : model.images) {
    model.cameras[id] = model.cameras.at(3);
    for (int axis = 0; axis < 2; ++axis) model.cameras[id].params[axis] *= 0.1 * id;
    image.camera_id = id;
  }
  const ModelOfClip clip = ReadModelOfClip(model, Frames(5), "model");
  const double focal_px = model.cameras.at(3).params[0];
  EXPECT_NEAR(CameraOf(clip.reconstruction, FrameIndex{3}).fx, 1.1 * focal_px, 1e-9);
  EXPECT_NEAR(CameraOf(clip.reconstruction, FrameIndex{0}).fx, 1.3 * focal_px, 1e-9);
  for (const bool with_camera : {false, true}) {
    const ColmapModel back = ReplaceInModel(model, clip, clip.reconstruction, with_camera);
    for (const auto& [id, image] : back.images) {
      EXPECT_EQ(image.camera_id, id);
      EXPECT_NEAR(back.cameras.at(id).params[1], 0.1 * id * focal_px, 1e-9);
    }
  }
}

TEST(ModelOfClip, AZoomThatWasFoundGivesEveryImageItsOwnCamera) {
  const ColmapModel model = Model();
  const ModelOfClip clip = ReadModelOfClip(model, Frames(5), "model");
  Reconstruction refined = clip.reconstruction;
  refined.focal_scale = {{FrameIndex{0}, 1.1}, {FrameIndex{3}, 0.9}};
  const ColmapModel back = ReplaceInModel(model, clip, refined, true);
  const double focal_px = model.cameras.at(3).params[0];
  EXPECT_THAT(back.cameras, ElementsAre(Key(11u), Key(12u), Key(13u)));
  EXPECT_EQ(back.cameras.at(back.images.at(11).camera_id).params[0], 0.9 * focal_px);
  EXPECT_EQ(back.cameras.at(back.images.at(12).camera_id).params[0], focal_px);
  EXPECT_EQ(back.cameras.at(back.images.at(13).camera_id).params[0], 1.1 * focal_px);
}

TEST(ModelOfClip, IdsOf64BitsComeBack) {
  ColmapModel model = Model();
  const std::uint64_t large = std::uint64_t{1} << 40;
  model.points[large] = model.points[8];
  const ModelOfClip clip = ReadModelOfClip(model, Frames(5), "model");
  EXPECT_THAT(clip.file.tracks.features(), ElementsAre(FeatureId{0}, FeatureId{1}, FeatureId{2}));
  const ColmapModel back = ReplaceInModel(model, clip, clip.reconstruction, false);
  EXPECT_THAT(back.points, ElementsAre(Key(5u), Key(8u), Key(large)));
}

TEST(ModelOfClip, ImagesThatAreNoFrameAreCountedAndTheirPointsLeftOut) {
  const ModelOfClip clip = ReadModelOfClip(Model(), Frames(1), "model");
  EXPECT_EQ(clip.unknown_images, 2u);
  EXPECT_EQ(clip.an_unknown_image, "images/3.png");
  EXPECT_THAT(clip.reconstruction.points, ElementsAre(Key(FeatureId{4})));
  EXPECT_EQ(clip.reconstruction.points.at(FeatureId{4}).views.size(), 1u);
  std::vector<FrameInfo> others = Frames(2);
  for (FrameInfo& frame : others) frame.name = "other" + frame.name;
  EXPECT_THAT(
      [&] { ReadModelOfClip(Model(), others, "model"); },
      ThrowsMessage<Error>(AllOf(HasSubstr("model: none of its 3 images is a frame of the clip"),
                                 HasSubstr("images/3.png"),
                                 HasSubstr("other0.png"))));
}

TEST(ModelOfClip, WhatIsNotFiniteIsAnError) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const auto fails = [](const auto& change, const char* why) {
    ColmapModel model = Model();
    change(model);
    EXPECT_THAT([&] { ReadModelOfClip(model, Frames(5), "model"); },
                ThrowsMessage<Error>(AllOf(HasSubstr("model"), HasSubstr(why))));
  };
  fails([](ColmapModel& m) { m.points[8].xyz.x() = kNan; }, "point 8 is not finite");
  fails([](ColmapModel& m) { m.images[12].cam_from_world.translation.x() = kNan; },
        "image images/1.png is not finite");
  fails([](ColmapModel& m) { m.images[12].cam_from_world.rotation.coeffs().setZero(); },
        "image images/1.png is not finite");
}

}  // namespace
}  // namespace cohort
