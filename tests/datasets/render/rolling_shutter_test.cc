// Rolling shutter: every row at its own time, in pictures, depth and truth.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "datasets/open_sequence.h"
#include "datasets/render/render.h"
#include "datasets/truth/track_truth.h"
#include "frontend/core/error.h"
#include "tests/datasets/fixtures.h"
#include "tests/datasets/render/displacement.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using test::TempDir;
using testing::HasSubstr;
using testing::Not;
using testing::ThrowsMessage;

constexpr double kPlaneZ = 4.0;
constexpr double kFrame = 67.0;  // half way along: the speed is even

SyntheticSceneOptions Options(double readout, SceneName scene = SceneName::kRoom) {
  SyntheticSceneOptions options;
  options.scene = scene;
  options.frames = 3;
  options.width_px = 320;
  options.height_px = 240;
  options.focal_px = 262.5;
  options.readout = readout;
  return options;
}

// A wall straight ahead of a camera that goes to the right on rails, 13 px a frame.
SceneDesign WallBesideRails() {
  SceneDesign design;
  design.ambient = 1.0;
  design.viewpoint.metres_per_frame = 0.2;
  design.viewpoint.shake = 0.0;
  Patch patch;
  patch.x_in_world = [](double s, double t, double) {
    return Eigen::Vector3d(12.0 * s - 5.0, 8.0 * t - 4.0, kPlaneZ);
  };
  patch.texture = {Material::kPoster, 12.0, 8.0, 70.0, 1.0};
  design.patches.push_back(patch);
  return design;
}

// By which a row is sheared [px].
double Shear(const SyntheticScene& scene, double y) {
  const double metres = scene.CamFromWorld(kFrame + 0.5).Inverse().translation.x() -
                        scene.CamFromWorld(kFrame - 0.5).Inverse().translation.x();
  const double px_per_frame = scene.camera().fx * metres / kPlaneZ;
  EXPECT_GT(px_per_frame, 10.0);
  const auto& options = scene.options();
  return -px_per_frame * options.readout * ((y + 0.5) / options.height_px - 0.5);
}

TEST(RollingShutter, TruthOfASidewaysCameraBeforeAWallIsShearedByTheReadout) {
  for (const double readout : {0.3, 1.0}) {
    const SyntheticScene scene(Options(readout), WallBesideRails());
    const SyntheticScene at_once(Options(0.0), WallBesideRails());
    const SceneMoment rolling(scene, kFrame);
    const SceneMoment global(at_once, kFrame);
    for (double y = 3.3; y < 240; y += 23) {
      for (double x = 12.2; x < 310; x += 31) {
        const auto point = global.Pick({x, y});
        ASSERT_TRUE(point);
        const auto sight = rolling.Locate(*point);
        ASSERT_TRUE(sight);
        EXPECT_NEAR(sight->xy.x(), x + Shear(scene, y), 1e-3);
        EXPECT_NEAR(sight->xy.y(), y, 1e-9);
        EXPECT_NEAR(sight->depth, kPlaneZ, 1e-9);
        // There and back.
        EXPECT_LT((rolling.Locate(*rolling.Pick({x, y}))->xy - Eigen::Vector2d(x, y)).norm(), 1e-6);
      }
    }
  }
}

TEST(RollingShutter, PictureOfASidewaysCameraBeforeAWallIsShearedByTheReadout) {
  const SyntheticScene scene(Options(1.0), WallBesideRails());
  const SyntheticScene at_once(Options(0.0), WallBesideRails());
  const Renderer global_renderer(at_once);
  const cv::Mat rolling = Renderer(scene).RenderLight(kFrame);
  const cv::Mat global = global_renderer.RenderLight(kFrame);
  for (const auto& [top, bottom] : {std::pair(8, 60), std::pair(100, 140), std::pair(180, 232)}) {
    std::vector<double> reference;
    std::vector<Eigen::Vector2d> at;
    for (int y = top; y < bottom; ++y) {
      for (int x = 24; x < 296; ++x) {
        reference.push_back(global.at<float>(y, x));
        at.emplace_back(x + Shear(scene, y), y);
      }
    }
    EXPECT_LT(test::Displacement(reference, rolling, at).norm(), 0.02) << top;
  }
  // Each row is that of the picture that is taken at its time.
  for (const int row : {0, 77, 239}) {
    const cv::Mat picture = global_renderer.RenderLight(scene.TimeOfRow(kFrame, row));
    EXPECT_EQ(cv::norm(picture.row(row), rolling.row(row), cv::NORM_INF), 0.0) << row;
  }
}

// The truth's pose is the middle row's, whatever the readout; rows beyond the picture do not exist.
TEST(RollingShutter, TimesOfRowsGoFromHalfAReadoutBeforeTheFrameToHalfOneAfter) {
  const SyntheticScene scene(Options(0.8), WallBesideRails());
  EXPECT_NEAR(scene.TimeOfRow(5.0, 119.5), 5.0, 1e-12);
  EXPECT_NEAR(scene.TimeOfRow(5.0, -0.5), 4.6, 1e-12);
  EXPECT_NEAR(scene.TimeOfRow(5.0, 239.5), 5.4, 1e-12);
  EXPECT_NEAR(scene.TimeOfRow(5.0, 59.5), 4.8, 1e-12);
  EXPECT_EQ(scene.TimeOfRow(5.0, -100.0), scene.TimeOfRow(5.0, -0.5));
  EXPECT_EQ(SyntheticScene(Options(0.0), WallBesideRails()).TimeOfRow(5.0, 3.0), 5.0);
}

// Rendered corners lie where the truth says, also of what moves, under a hand that shakes.
TEST(RollingShutter, TruthAgreesWithPictures) {
  SyntheticSceneOptions options = Options(1.0, SceneName::kBodies);
  options.motion = Motion::kOrbit;
  options.width_px = 256;
  options.height_px = 192;
  options.focal_px = 210.0;
  const test::TruthErrors errors = test::CompareTruthWithPictures(options, 20.0, 26.0);
  EXPECT_GT(errors.count, 40u);
  EXPECT_LT(errors.median_px, 0.04);
  EXPECT_LT(errors.p90_px, 0.1);
  EXPECT_LT(errors.bias_px, 0.015);
}

// Of a clip as written: a track's truth solves for its row, and hidden is what a depth picture of
// the same shutter shows something nearer at.
TEST(RollingShutter, TruthOfAClipSolvesForTheRow) {
  const TempDir dir;
  const SyntheticSceneOptions options = Options(0.9, SceneName::kTabletop);
  test::WriteSceneWithoutPictures(options, dir / "clip");
  const auto sequence = OpenSequence(dir / "clip");
  const auto truth = OpenTrackTruth(*sequence, dir / "clip");
  const SyntheticScene scene(options);
  const FrameIndex later{60};
  const cv::Mat depth = RenderDepth(scene, 60.0);
  double most = 0.0;
  int hidden = 0;
  int shown = 0;
  int slopes = 0;  // hidden ones that the depth picture would show
  for (double y = 5; y < 235; y += 6) {
    for (double x = 5; x < 315; x += 6) {
      const auto anchor = truth->Pick(FrameIndex{0}, {x, y});
      ASSERT_TRUE(anchor);
      const auto position = truth->Locate(*anchor, later);
      if (!position || !position->in_image) continue;
      const Rigid3 cam_from_world = scene.CamFromWorld(scene.TimeOfRow(60.0, position->xy.y()));
      const Eigen::Vector3d x_in_cam = cam_from_world * anchor->x_in_world;
      EXPECT_LT((*scene.camera().Project(x_in_cam) - position->xy).norm(), 1e-8);
      const Rigid3 middle = scene.CamFromWorld(60.0);
      most = std::max(most,
                      (*scene.camera().Project(middle * anchor->x_in_world) - position->xy).norm());
      if (truth->IsOnDepthEdge(later, position->xy, 2.0)) continue;
      const float seen = depth.at<float>(static_cast<int>(std::lround(position->xy.y())),
                                         static_cast<int>(std::lround(position->xy.x())));
      // On a slope the depth of the pixel's centre says nothing to within a few per cent.
      const double ratio = x_in_cam.z() / seen;
      if (ratio > 1.0 && ratio < 1.06) slopes += position->visible ? 0 : 1;
      if (position->visible || ratio > 1.06) {
        EXPECT_EQ(position->visible, ratio < 1.03) << position->xy.transpose();
      }
      (position->visible ? shown : hidden) += 1;
    }
  }
  EXPECT_GT(most, 0.5);  // px by which a global shutter's truth would be wrong
  EXPECT_GT(shown, 500);
  EXPECT_GT(hidden, 20);
  EXPECT_LT(slopes, shown / 50);
}

TEST(RollingShutter, SceneFileSaysTheReadoutOnlyWhereThereIsOne) {
  SceneFile file;
  EXPECT_THAT(file.Text(), Not(HasSubstr("readout")));
  file.options.readout = 0.65;
  const TempDir dir;
  test::WriteText(dir / "scene.json", file.Text());
  EXPECT_EQ(ReadSceneFile(dir.path())->options.readout, 0.65);
  file.options.readout = 1.5;
  test::WriteText(dir / "scene.json", file.Text());
  EXPECT_THAT([&] { ReadSceneFile(dir.path()); }, ThrowsMessage<Error>(HasSubstr("readout")));
}

}  // namespace
}  // namespace cohort
