// The renderer: pictures, depth and poses agree with each other and with closed forms.
#include "datasets/render/synthetic_scene.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "datasets/open_sequence.h"
#include "datasets/render/render.h"
#include "datasets/render/scene_geometry.h"
#include "frontend/core/error.h"
#include "frontend/storage/output.h"
#include "tests/datasets/fixtures.h"
#include "tests/datasets/render/displacement.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using test::Cubic;
using test::Displacement;
using test::TempDir;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

SyntheticSceneOptions Small(SceneName scene, Motion motion = Motion::kLateral) {
  SyntheticSceneOptions options;
  options.scene = scene;
  options.motion = motion;
  options.frames = 3;
  options.width_px = 320;
  options.height_px = 240;
  options.focal_px = 262.5;
  return options;
}

// One flat surface, lit evenly, before a camera that moves as in any scene.
SceneDesign OneQuad(const Eigen::Vector3d& corner,
                    const Eigen::Vector3d& right,
                    const Eigen::Vector3d& down,
                    Material material) {
  SceneDesign design;
  design.ambient = 1.0;
  Patch patch;
  patch.x_in_world = [=](double s, double t, double) -> Eigen::Vector3d {
    return corner + s * right + t * down;
  };
  patch.texture = {material, right.norm(), down.norm(), 100.0, 1.0};
  design.patches.push_back(patch);
  return design;
}

TEST(Renderer, ShowsTheTextureWhereTheProjectionSays) {
  SyntheticSceneOptions options = Small(SceneName::kRoom);
  const Eigen::Vector3d corner(-3.0, -2.5, 3.0);
  const Eigen::Vector3d right(6.0, 0.0, 0.0);
  const Eigen::Vector3d down(0.0, 5.0, 0.0);
  const SyntheticScene scene(options, OneQuad(corner, right, down, Material::kPoster));
  const Renderer renderer(scene);
  // The same random numbers as the renderer draws; light does not vary.
  const cv::Mat texture =
      MakeTexture(scene.patches()[0].texture, RandomStream(options.seed, "scene/texture").Fork(0));
  for (const int frame : {0, 17}) {
    const cv::Mat picture = renderer.RenderLight(frame);
    const Rigid3 world_from_cam = scene.CamFromWorld(frame).Inverse();
    std::vector<double> expected;
    std::vector<Eigen::Vector2d> at;
    double scale = 0.0;
    for (int y = 8; y < options.height_px - 8; ++y) {
      for (int x = 8; x < options.width_px - 8; ++x) {
        // Mean over the pixel and a little around it, of the plane's texture in closed form.
        double sum = 0.0;
        for (int k = 0; k < 36; ++k) {
          const int row = k / 6;
          const Eigen::Vector2d xy(x + ((k % 6) - 2.5) / 4.0, y + (row - 2.5) / 4.0);
          const Eigen::Vector3d ray =
              world_from_cam.rotation * scene.camera().Unproject(xy).homogeneous();
          const Eigen::Vector3d hit = world_from_cam.translation +
                                      (corner.z() - world_from_cam.translation.z()) / ray.z() * ray;
          const Eigen::Vector2d texel((hit.x() - corner.x()) * 100.0 - 0.5,
                                      (hit.y() - corner.y()) * 100.0 - 0.5);
          sum += Cubic(texture, texel);
        }
        expected.push_back(sum / 36.0);
        at.emplace_back(x, y);
        scale += picture.at<float>(y, x) / expected.back();
      }
    }
    scale /= static_cast<double>(at.size());
    double error = 0.0;
    double spread = 0.0;
    for (std::size_t i = 0; i < at.size(); ++i) {
      expected[i] *= scale;
      const double value =
          picture.at<float>(static_cast<int>(at[i].y()), static_cast<int>(at[i].x()));
      error += std::pow(value - expected[i], 2);
      spread += std::pow(expected[i] - 0.2, 2);
    }
    EXPECT_LT(std::sqrt(error / spread), 0.15) << frame;
    EXPECT_LT(Displacement(expected, picture, at).norm(), 0.005) << frame;
  }
}

TEST(Renderer, DepthIsThePlanesEquation) {
  const SyntheticSceneOptions options = Small(SceneName::kRoom, Motion::kOrbit);
  const Eigen::Vector3d corner(-12.0, -9.0, 3.0);
  const Eigen::Vector3d right(25.0, 0.0, 4.0);
  const Eigen::Vector3d down(0.5, 18.0, 2.0);
  const SyntheticScene scene(options, OneQuad(corner, right, down, Material::kConcrete));
  const cv::Mat depth = RenderDepth(scene, 5.0);
  const Rigid3 cam_from_world = scene.CamFromWorld(5.0);
  const Eigen::Vector3d normal = cam_from_world.rotation * right.cross(down);
  const double distance = normal.dot(cam_from_world * corner);
  for (int y = 0; y < depth.rows; y += 7) {
    for (int x = 0; x < depth.cols; x += 7) {
      const Eigen::Vector3d ray = scene.camera().Unproject(Eigen::Vector2d(x, y)).homogeneous();
      EXPECT_NEAR(depth.at<float>(y, x), distance / normal.dot(ray), 1e-5);
    }
  }
}

// What is near hides what is far, also where a surface reaches behind the camera.
TEST(Renderer, NearSurfacesHideFarOnes) {
  const SyntheticSceneOptions options = Small(SceneName::kRoom);
  SceneDesign design = OneQuad({-9, -9, 6}, {18, 0, 0}, {0, 18, 0}, Material::kBricks);
  for (const SceneDesign& more :
       {OneQuad({-0.5, -0.5, 3}, {1, 0, 0}, {0, 1, 0}, Material::kPoster),
        OneQuad({-9, 1.5, 6}, {18, 0, 0}, {0, 0, -12}, Material::kTiles)}) {
    design.patches.push_back(more.patches[0]);
  }
  const SyntheticScene scene(options, design);
  const cv::Mat depth = RenderDepth(scene, 0.0);
  const Rigid3 world_from_cam = scene.CamFromWorld(0.0).Inverse();
  const Eigen::Vector3d eye = world_from_cam.translation;
  int seen[3] = {0, 0, 0};
  for (int y = 0; y < depth.rows; ++y) {
    for (int x = 0; x < depth.cols; ++x) {
      const Eigen::Vector3d ray =
          world_from_cam.rotation * scene.camera().Unproject(Eigen::Vector2d(x, y)).homogeneous();
      double nearest = (6.0 - eye.z()) / ray.z();
      int surface = 0;
      if (const double to_floor = (1.5 - eye.y()) / ray.y(); to_floor > 0 && to_floor < nearest) {
        nearest = to_floor;
        surface = 2;
      }
      const double to_poster = (3.0 - eye.z()) / ray.z();
      const Eigen::Vector3d hit = eye + to_poster * ray;
      const double inside = 0.5 - std::max(std::abs(hit.x()), std::abs(hit.y()));
      if (std::abs(inside) < 1e-6) continue;
      if (inside > 0.0 && to_poster < nearest) {
        nearest = to_poster;
        surface = 1;
      }
      ++seen[surface];
      ASSERT_NEAR(depth.at<float>(y, x), nearest, 1e-4) << x << " " << y;
    }
  }
  EXPECT_THAT(seen, testing::Each(testing::Gt(2000)));
}

class Scenes : public testing::TestWithParam<SceneName> {};

// Surfaces fill the picture, at several depths, and the camera runs into none.
TEST_P(Scenes, FillThePictureAtSeveralDepthsOnEveryPath) {
  for (const Motion motion : {Motion::kLateral, Motion::kForward, Motion::kOrbit}) {
    const SyntheticScene scene(Small(GetParam(), motion));
    std::vector<double> depths;
    for (int frame = 0; frame < 120; frame += 7) {
      const SceneMoment moment(scene, frame);
      for (int y = 4; y < 240; y += 12) {
        for (int x = 4; x < 320; x += 12) {
          const double inverse_depth = moment.InverseDepth(Eigen::Vector2d(x, y));
          ASSERT_GT(inverse_depth, 0.0) << frame << ": " << x << " " << y;
          depths.push_back(1.0 / inverse_depth);
        }
      }
    }
    std::sort(depths.begin(), depths.end());
    EXPECT_GT(depths.front(), 0.8);
    EXPECT_GT(depths[depths.size() * 9 / 10], 1.4 * depths[depths.size() / 10]);
    const double way = (scene.CamFromWorld(0).Inverse().translation -
                        scene.CamFromWorld(119).Inverse().translation)
                           .norm();
    EXPECT_GT(way, 1.4);
    EXPECT_LT(way, 3.2);
  }
}

// A few scenes; the others are in the slow tests.
TEST(Truth, AgreesWithPicturesBetweenFrames) {
  for (const SceneName scene : {SceneName::kTabletop, SceneName::kCloth}) {
    const test::TruthErrors errors =
        test::CompareTruthWithPictures(Small(scene, Motion::kOrbit), 20.0, 26.0);
    SCOPED_TRACE(NameOf(kSceneNames, scene));
    EXPECT_GT(errors.count, 40u);
    EXPECT_LT(errors.median_px, 0.04);
    EXPECT_LT(errors.p90_px, 0.1);
    EXPECT_LT(errors.bias_px, 0.015);
  }
}

INSTANTIATE_TEST_SUITE_P(All,
                         Scenes,
                         testing::ValuesIn([] {
                           std::vector<SceneName> all;
                           for (const auto& [name, scene] : kSceneNames) all.push_back(scene);
                           return all;
                         }()),
                         [](const auto& info) {
                           return std::string(NameOf(kSceneNames, info.param));
                         });

TEST(SyntheticScene, OnlyBodiesAndClothMove) {
  for (const auto& [name, value] : kSceneNames) {
    const SyntheticScene scene(Small(value));
    const auto before = scene.VerticesInWorld(0.0);
    const auto after = scene.VerticesInWorld(30.0);
    const bool moves = before != after;
    EXPECT_EQ(moves, value == SceneName::kBodies || value == SceneName::kCloth) << name;
  }
}

// Bodies are rigid; the cloth is not.
TEST(SyntheticScene, BodiesKeepTheirShapeAndTheClothDoesNot) {
  for (const SceneName name : {SceneName::kBodies, SceneName::kCloth}) {
    const SyntheticScene scene(Small(name));
    const auto before = scene.VerticesInWorld(0.0);
    const auto after = scene.VerticesInWorld(40.0);
    double most = 0.0;
    for (const SyntheticScene::Triangle& triangle : scene.triangles()) {
      if (!scene.patches()[triangle.patch].moves) continue;
      const auto [a, b, c] = triangle.vertices;
      most = std::max(most,
                      std::abs((before[a] - before[b]).norm() / (after[a] - after[b]).norm() - 1));
    }
    if (name == SceneName::kBodies) {
      EXPECT_LT(most, 1e-9);
    } else {
      EXPECT_GT(most, 1e-2);
    }
  }
}

TEST(RenderSequence, OpensAgainWithExactPosesAndDepth) {
  const TempDir dir;
  SyntheticSceneOptions options = Small(SceneName::kCloth, Motion::kForward);
  options.width_px = 160;
  options.height_px = 120;
  std::size_t calls = 0;
  RenderSequence(options, dir / "clip", [&](std::size_t done, std::size_t total) {
    EXPECT_EQ(done, ++calls);
    EXPECT_EQ(total, 3u);
  });
  EXPECT_EQ(calls, 3u);

  const SyntheticScene scene(options);
  const Renderer renderer(scene);
  const auto sequence = OpenSequence(dir / "clip");
  const std::vector<Frame> frames = test::ReadAll(*sequence);
  ASSERT_EQ(frames.size(), 3u);
  EXPECT_EQ(frames[2].timestamp_ns, 66'666'666);
  ASSERT_TRUE(sequence->KnownCamera());
  EXPECT_EQ(sequence->KnownCamera()->fx, 262.5);
  EXPECT_EQ(sequence->KnownCamera()->cx, 79.5);
  ASSERT_EQ(sequence->TrueCamFromWorld().size(), 3u);
  for (const Frame& frame : frames) {
    const auto i = static_cast<double>(ToInt(frame.index));
    EXPECT_EQ(cv::norm(frame.gray, renderer.RenderGray(i), cv::NORM_INF), 0.0);
    const auto depth = sequence->TrueDepth(frame.index);
    ASSERT_TRUE(depth);
    EXPECT_LT(cv::norm(*depth, RenderDepth(scene, i), cv::NORM_INF), 1.01e-4);
    const Rigid3 error =
        sequence->TrueCamFromWorld().at(frame.index) * scene.CamFromWorld(i).Inverse();
    EXPECT_LT(error.translation.norm(), 1e-12);
    EXPECT_LT(AngleBetween(error.rotation, Eigen::Quaterniond::Identity()), 1e-12);
  }

  const auto file = ReadSceneFile(dir / "clip");
  ASSERT_TRUE(file);
  EXPECT_EQ(file->options.scene, SceneName::kCloth);
  EXPECT_EQ(file->options.motion, Motion::kForward);
  EXPECT_EQ(file->options.frames, 3);
  EXPECT_EQ(file->options.seed, options.seed);
  EXPECT_EQ(file->Text(), ReadBytes(dir / "clip/scene.json"));
}

std::map<std::string, std::string> BytesOf(const fs::path& folder) {
  std::map<std::string, std::string> bytes;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) {
      bytes[fs::relative(entry.path(), folder).string()] = ReadBytes(entry.path());
    }
  }
  return bytes;
}

TEST(RenderSequence, TheSameSeedGivesTheSameBytesForAnyThreadCount) {
  const TempDir dir;
  SyntheticSceneOptions options = Small(SceneName::kCloth);
  options.width_px = 96;
  options.height_px = 72;
  options.focal_px = 80.0;
  RenderSequence(options, dir / "a", {}, 1);
  RenderSequence(options, dir / "b", {}, 3);
  EXPECT_EQ(BytesOf(dir / "a"), BytesOf(dir / "b"));
  options.seed = 2;
  RenderSequence(options, dir / "c", {}, 1);
  EXPECT_NE(BytesOf(dir / "a"), BytesOf(dir / "c"));
}

// A longer clip begins with the shorter one.
TEST(RenderSequence, FramesDoNotDependOnHowManyThereAre) {
  const TempDir dir;
  SyntheticSceneOptions options = Small(SceneName::kCloth);
  options.width_px = 64;
  options.height_px = 64;
  options.focal_px = 50.0;
  options.frames = 1;
  RenderSequence(options, dir / "one");
  options.frames = 2;
  RenderSequence(options, dir / "two");
  EXPECT_EQ(ReadBytes(dir / "one/rgb/000000.png"), ReadBytes(dir / "two/rgb/000000.png"));
}

TEST(RenderSequence, LeavesTheOldFolderWhenItCannotWrite) {
  const TempDir dir;
  const SyntheticSceneOptions options = Small(SceneName::kCloth);
  EXPECT_THAT([&] { RenderSequence(options, dir / "no/such/clip"); },
              ThrowsMessage<Error>(HasSubstr("no/such")));
  fs::create_directory(dir / "mine");
  std::ofstream(dir / "mine/diary.txt") << "dear";
  EXPECT_THAT([&] { RenderSequence(options, dir / "mine"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("mine"), HasSubstr("diary.txt"))));
  EXPECT_TRUE(fs::exists(dir / "mine/diary.txt"));
  EXPECT_FALSE(fs::exists(dir / "mine.partial"));
}

TEST(ReadSceneFile, NamesWhatItCannotUse) {
  const TempDir dir;
  EXPECT_FALSE(ReadSceneFile(dir.path()));
  const std::string good = SceneFile{}.Text();
  const auto read = [&](const std::string& text) {
    std::ofstream(dir / "scene.json") << text;
    return ReadSceneFile(dir.path());
  };
  EXPECT_TRUE(read(good));
  EXPECT_THAT([&] { read("{"); }, ThrowsMessage<Error>(HasSubstr("scene.json")));
  SceneFile large;
  large.options.seed = 4294967295U;
  large.options.focal_px = 1234.5678;
  EXPECT_EQ(read(large.Text())->Text(), large.Text());
  std::string bad = good;
  bad.replace(bad.find("room"), 4, "moon");
  EXPECT_THAT([&] { read(bad); }, ThrowsMessage<Error>(HasSubstr("moon")));
  const auto with = [&](const std::string& old, const std::string& text) {
    std::string changed = good;
    changed.replace(changed.find(old), old.size(), text);
    return [&read, changed] { read(changed); };
  };
  EXPECT_THAT(with("\"frames\": ", "\"frames\": 1."), ThrowsMessage<Error>(HasSubstr("frames")));
  EXPECT_THAT(with("\"frames\": ", "\"frames\": 99999999999"),
              ThrowsMessage<Error>(HasSubstr("frames")));
  EXPECT_THAT(with("\"frame_step\": ", "\"steps\": "),
              ThrowsMessage<Error>(HasSubstr("frame_step")));
  EXPECT_THAT(with("\"frame_step\": 1", "\"frame_step\": 2147483647"),
              ThrowsMessage<Error>(HasSubstr("frame_step 2147483647 is beyond")));
  EXPECT_THAT(with("\"first_frame\": 0", "\"first_frame\": 10000001"),
              ThrowsMessage<Error>(HasSubstr("first_frame 10000001")));
  EXPECT_THAT(with("\"frames\": ", "\"frames\": 7, \"frames\": "),
              ThrowsMessage<Error>(HasSubstr("\"frames\" occurs twice")));
  EXPECT_THAT(with("\"seed\": \"", "\"seed\": \"x"), ThrowsMessage<Error>(HasSubstr("seed")));
  bad = good;
  bad.replace(bad.find("\"version\": ") + 11, 1, "999");
  EXPECT_THAT([&] { read(bad); },
              ThrowsMessage<Error>(AllOf(HasSubstr("version 999"), HasSubstr("render"))));
}

TEST(SceneFile, CountsItsFramesUpToTheMostThatAreTaken) {
  SceneFile file;
  file.first_frame = 5;
  file.frame_step = SceneFile::kMostFrame;
  EXPECT_EQ(file.FrameOf(FrameIndex{0}), 5);
  EXPECT_THAT([&] { file.FrameOf(FrameIndex{1}); },
              ThrowsMessage<Error>(HasSubstr("frame 10000005 of its scene")));
  EXPECT_THAT([&] { file.FrameOf(FrameIndex{4294967295U}); }, testing::Throws<Error>());
}

}  // namespace
}  // namespace cohort
