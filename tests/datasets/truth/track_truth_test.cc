// Truth of tracks: from a rendered scene and from depth pictures, against closed forms.
#include "datasets/truth/track_truth.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "datasets/degrade/degrade.h"
#include "datasets/open_sequence.h"
#include "datasets/readers/tum_writer.h"
#include "datasets/render/render.h"
#include "datasets/render/synthetic_scene.h"
#include "frontend/core/error.h"
#include "tests/datasets/fixtures.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using test::TempDir;

class Clip : public testing::Test {
 protected:
  std::unique_ptr<TrackTruth> Open(SceneName scene, bool keep_scene_file = true) {
    options_.scene = scene;
    options_.frames = 12;
    options_.width_px = 320;
    options_.height_px = 240;
    options_.focal_px = 262.5;
    test::WriteSceneWithoutPictures(options_, dir_ / "clip");
    if (!keep_scene_file) fs::remove(dir_ / "clip/scene.json");
    sequence_ = OpenSequence(dir_ / "clip");
    return OpenTrackTruth(*sequence_, dir_ / "clip");
  }
  TempDir dir_;
  SyntheticSceneOptions options_;
  std::unique_ptr<Sequence> sequence_;
};

TEST_F(Clip, TheSceneAndItsDepthPicturesTellTheSameOfARigidScene) {
  const auto exact = Open(SceneName::kTabletop);
  ASSERT_NE(exact, nullptr);
  const auto plain = OpenSequence(dir_ / "clip");
  fs::remove(dir_ / "clip/scene.json");
  const auto depth = OpenTrackTruth(*plain, dir_ / "clip");
  ASSERT_NE(depth, nullptr);

  int both = 0;
  int near = 0;
  int exact_place = 0;
  int same_visibility = 0;
  int edges = 0;
  int same_edges = 0;
  int places = 0;
  for (double y = 5.3; y < 235; y += 9) {
    for (double x = 5.6; x < 315; x += 9) {
      ++places;
      const Eigen::Vector2d xy(x, y);
      const auto a = exact->Pick(FrameIndex{0}, xy);
      const auto b = depth->Pick(FrameIndex{0}, xy);
      ASSERT_TRUE(a);
      edges += exact->IsOnDepthEdge(FrameIndex{0}, xy, 4.0);
      same_edges += exact->IsOnDepthEdge(FrameIndex{0}, xy, 4.0) ==
                    depth->IsOnDepthEdge(FrameIndex{0}, xy, 4.0);
      const auto home = exact->Locate(*a, FrameIndex{0});
      ASSERT_TRUE(home);
      EXPECT_LT((home->xy - xy).norm(), 1e-6);
      EXPECT_TRUE(home->visible);
      if (!b || depth->IsOnDepthEdge(FrameIndex{0}, xy, 2.0)) continue;
      EXPECT_LT((a->x_in_world - b->x_in_world).norm(),
                0.02 * 6.0);  // at most the step it may bridge
      near += (a->x_in_world - b->x_in_world).norm() < 2e-3;
      const auto pa = exact->Locate(*a, FrameIndex{11});
      const auto pb = depth->Locate(*b, FrameIndex{11});
      ASSERT_TRUE(pa && pb);
      exact_place += (pa->xy - pb->xy).norm() < 0.02;
      EXPECT_EQ(pa->in_image, pb->in_image);
      same_visibility += pa->visible == pb->visible;
      ++both;
    }
  }
  EXPECT_GT(both, places * 6 / 10);
  EXPECT_GT(near, both * 97 / 100);
  EXPECT_GT(exact_place, both * 97 / 100);
  EXPECT_GT(same_visibility, both * 95 / 100);
  EXPECT_GT(edges, places / 20);
  EXPECT_LT(edges, places / 2);
  EXPECT_GT(same_edges, places * 85 / 100);
}

// Followed frame by frame, a pixel's point is where the renderer puts the surface: its depth there
// is the point's own.
TEST_F(Clip, PointsOfMovingBodiesMoveWithThem) {
  for (const SceneName name : {SceneName::kBodies, SceneName::kCloth}) {
    const auto truth = Open(name);
    const SyntheticScene scene(options_);
    const cv::Mat depth = RenderDepth(scene, 9.0);
    int moved = 0;
    int visible = 0;
    for (double y = 10; y < 230; y += 11) {
      for (double x = 10; x < 310; x += 11) {
        const auto anchor = truth->Pick(FrameIndex{0}, {x, y});
        ASSERT_TRUE(anchor);
        const auto later = truth->Locate(*anchor, FrameIndex{9});
        ASSERT_TRUE(later);
        if (!later->visible || truth->IsOnDepthEdge(FrameIndex{9}, later->xy, 2.0)) continue;
        ++visible;
        const auto again = truth->Pick(FrameIndex{9}, later->xy);
        ASSERT_TRUE(again);
        EXPECT_EQ(again->on_surface.triangle, anchor->on_surface.triangle);
        EXPECT_LT((again->on_surface.weights - anchor->on_surface.weights).norm(), 1e-6);
        const double z = (scene.CamFromWorld(9.0) * again->x_in_world).z();
        const int px = static_cast<int>(std::lround(later->xy.x()));
        const int py = static_cast<int>(std::lround(later->xy.y()));
        EXPECT_NEAR(depth.at<float>(py, px) / z, 1.0, 0.02);
        moved += (again->x_in_world - anchor->x_in_world).norm() > 1e-3;
      }
    }
    EXPECT_GT(visible, 300);
    EXPECT_GT(moved, 50);
    EXPECT_LT(moved, visible);
  }
}

// A point is visible as long as nothing on its ray is nearer.
TEST_F(Clip, HiddenPointsAreSaidToBeHidden) {
  const auto truth = Open(SceneName::kTabletop);
  const Rigid3 cam_from_world = SyntheticScene(options_).CamFromWorld(60.0);
  const FrameIndex late{60};  // a scene has every frame
  int hidden = 0;
  int shown = 0;
  for (double y = 5; y < 235; y += 5) {
    for (double x = 5; x < 315; x += 5) {
      const auto anchor = truth->Pick(FrameIndex{0}, {x, y});
      const auto later = truth->Locate(*anchor, late);
      if (!later || !later->in_image || truth->IsOnDepthEdge(late, later->xy, 2.0)) continue;
      const double z = (cam_from_world * anchor->x_in_world).z();
      const double z_seen = (cam_from_world * truth->Pick(late, later->xy)->x_in_world).z();
      EXPECT_EQ(later->visible, z < 1.001 * z_seen);
      (later->visible ? shown : hidden) += 1;
    }
  }
  EXPECT_GT(hidden, 30);
  EXPECT_GT(shown, 1000);
}

TEST_F(Clip, TheForegroundBarHidesAndShowsNoPoint) {
  Open(SceneName::kCloth);
  DegradeOptions options;
  options.occluder_px_per_frame = 30.0;
  DegradeSequence(*sequence_, dir_ / "clip", sequence_->KnownCamera(), options, dir_ / "dark");
  for (const bool scene_file : {true, false}) {
    if (!scene_file) fs::remove(dir_ / "dark/scene.json");
    const auto dark = OpenSequence(dir_ / "dark");
    const auto truth = OpenTrackTruth(*dark, dir_ / "dark");
    // In frame 6 the bar covers columns 100 to 179.
    EXPECT_TRUE(truth->Pick(FrameIndex{6}, {95.0, 120.0}));
    EXPECT_FALSE(truth->Pick(FrameIndex{6}, {140.0, 120.0}));
    const auto anchor = truth->Pick(FrameIndex{0}, {140.0, 120.0});
    ASSERT_TRUE(anchor);
    EXPECT_TRUE(truth->Locate(*anchor, FrameIndex{1})->visible);
    const auto hidden = truth->Locate(*anchor, FrameIndex{6});
    ASSERT_LT(std::abs(hidden->xy.x() - 140.0), 35.0);
    EXPECT_TRUE(hidden->in_image);
    EXPECT_FALSE(hidden->visible);
  }
}

TEST_F(Clip, OfAPartOfAClipIsTheTruthOfThoseFrames) {
  const auto whole = Open(SceneName::kBodies);
  const auto part_of_it = OpenSequence(dir_ / "clip", Layout::kAuto, FrameRange::Parse("3:12:4"));
  DegradeSequence(
      *part_of_it, dir_ / "clip", part_of_it->KnownCamera(), DegradeOptions{}, dir_ / "part");
  const auto part = OpenSequence(dir_ / "part");
  const auto truth = OpenTrackTruth(*part, dir_ / "part");
  const auto a = whole->Pick(FrameIndex{3}, {200.0, 150.0});
  const auto b = truth->Pick(FrameIndex{0}, {200.0, 150.0});
  ASSERT_TRUE(a && b);
  EXPECT_LT((whole->Locate(*a, FrameIndex{11})->xy - truth->Locate(*b, FrameIndex{2})->xy).norm(),
            1e-9);
}

TEST(TrackTruth, IsNoneWithoutDepthOrPoses) {
  const TempDir dir;
  for (int i = 0; i < 2; ++i) test::WriteImage(dir / fmt::format("{}.png", i), 100);
  const auto sequence = OpenSequence(dir.path());
  EXPECT_EQ(OpenTrackTruth(*sequence, dir.path()), nullptr);
}

TEST_F(Clip, ASceneFileOfOtherPicturesIsAnError) {
  Open(SceneName::kTabletop);
  SceneFile other = *ReadSceneFile(dir_ / "clip");
  other.options.width_px = 640;
  test::WriteText(dir_ / "clip/scene.json", other.Text());
  const auto both_sizes = testing::ThrowsMessage<Error>(
      testing::AllOf(testing::HasSubstr("640x240"), testing::HasSubstr("320x240")));
  EXPECT_THAT([&] { OpenTrackTruth(*sequence_, dir_ / "clip"); }, both_sizes);
  fs::remove(dir_ / "clip/calibration.txt");
  const auto without_calibration = OpenSequence(dir_ / "clip");
  EXPECT_THAT([&] { OpenTrackTruth(*without_calibration, dir_ / "clip"); }, both_sizes);
}

TEST_F(Clip, AFrameBeyondTheSceneIsAnError) {
  Open(SceneName::kTabletop);
  SceneFile file = *ReadSceneFile(dir_ / "clip");
  file.frame_step = SceneFile::kMostFrame;
  test::WriteText(dir_ / "clip/scene.json", file.Text());
  const auto truth = OpenTrackTruth(*sequence_, dir_ / "clip");
  const auto beyond = testing::ThrowsMessage<Error>(testing::HasSubstr("of its scene"));
  EXPECT_THAT([&] { truth->Pick(FrameIndex{3}, {100.0, 100.0}); }, beyond);
  EXPECT_THAT(
      [&] {
        DegradeSequence(*OpenSequence(dir_ / "clip", Layout::kAuto, FrameRange::Parse("3:")),
                        dir_ / "clip",
                        std::nullopt,
                        {},
                        dir_ / "dark");
      },
      beyond);
}

// Of a step of the depth: what is above it is no neighbour of what is below.
TEST(DepthTruth, PicturesMayBeOnePixelWide) {
  const TempDir dir;
  TumWriter writer(dir / "clip");
  writer.WriteCamera(
      {.width_px = 1, .height_px = 20, .fx = 20.0, .fy = 20.0, .cx = 0.0, .cy = 9.5});
  TumWriter::Record record;
  record.picture = cv::Mat(20, 1, CV_8UC1, cv::Scalar(100));
  record.depth_m = cv::Mat(20, 1, CV_32FC1, cv::Scalar(2.0));
  record.depth_m->rowRange(0, 10) = 1.0;
  record.cam_from_world = Rigid3{};
  writer.Write(0, record);
  writer.Finish();
  const auto sequence = OpenSequence(dir / "clip");
  const auto truth = OpenTrackTruth(*sequence, dir / "clip");
  ASSERT_NE(truth, nullptr);
  const auto depth_at = [&](double y) {
    const auto anchor = truth->Pick(FrameIndex{0}, {0.0, y});
    return anchor ? anchor->x_in_world.z() : 0.0;
  };
  EXPECT_NEAR(depth_at(0.0), 1.0, 1e-3);
  EXPECT_EQ(depth_at(9.5), 0.0);
  EXPECT_NEAR(depth_at(10.0), 2.0, 1e-3);
  EXPECT_NEAR(depth_at(18.5), 2.0, 1e-3);
}

}  // namespace
}  // namespace cohort
