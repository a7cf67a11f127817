#include "backend/mapper/camera_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "backend/adjust/lens_changes.h"
#include "backend/mapper/mapper.h"
#include "backend/scene/keyframes.h"
#include "tests/support/cameras.h"
#include "tests/support/synthetic_tracks.h"
#include "tests/support/zoom.h"

namespace cohort {
namespace {

using test::CameraPath;
using test::MakeSyntheticTracks;
using test::SyntheticTracks;
using test::SyntheticTracksOptions;

constexpr CameraRefinement kAll{.focal = true, .radial = true, .principal_point = true};

Camera Guess(const Camera& truth, double focal_px) {
  return Camera::Guess(truth.width_px, truth.height_px, focal_px, 1.0);
}

std::optional<FoundCamera> Search(const SyntheticTracks& scene, double focal_px) {
  const WhitenedTracks whitened(scene.file, {});
  const Camera guess = Guess(*scene.file.camera, focal_px);
  return SearchCamera(whitened, guess, std::nullopt, kAll, SelectKeyframes(whitened, guess));
}

SyntheticTracks Scene(CameraPath path, const Camera& camera, int points = 150) {
  SyntheticTracksOptions options;
  options.path = path;
  options.frames = 40;
  options.points = points;
  options.noise_px = 0.3;
  options.camera = camera;
  return MakeSyntheticTracks(options);
}

TEST(CameraSearch, FindsTheFocalLengthFromAnyStart) {
  for (const CameraPath path : {CameraPath::kArc, CameraPath::kForward}) {
    const SyntheticTracks scene = Scene(path, SyntheticTracksOptions::DefaultCamera());
    for (const double wrong : {0.5, 0.7, 1.0, 1.5, 2.0}) {
      const auto found = Search(scene, wrong * 500.0);
      ASSERT_TRUE(found) << "from " << wrong << " times the true focal length";
      EXPECT_NEAR(found->camera.fx, 500.0, 15.0) << "from " << wrong << " times it";
      EXPECT_FALSE(found->rival);
      EXPECT_FALSE(found->camera.known);
    }
  }
}

// The same minimum from half the true focal length as from twice it, and from the result itself.
TEST(CameraSearch, AReconstructionEndsAtOneFocalLengthFromAnyStart) {
  SyntheticTracks scene = Scene(CameraPath::kArc, SyntheticTracksOptions::DefaultCamera());
  std::optional<double> first;
  for (const double focal_px : {250.0, 500.0, 1000.0, 0.0}) {
    scene.file.camera = Guess(*scene.file.camera, focal_px > 0.0 ? focal_px : *first);
    const MapperResult result = ReconstructWithCeres(scene.file);
    ASSERT_EQ(result.termination, MapperTermination::kSuccess) << result.summary.Brief();
    const double found = result.reconstruction.camera.fx;
    EXPECT_NEAR(found, 500.0, 15.0);
    if (!first) first = found;
    EXPECT_NEAR(found, *first, 0.005 * *first) << "from " << focal_px << " px";
  }
}

// The second pass hands on what the first model found, the prior apart.
TEST(CameraSearch, BeginsWithTheCameraThatWasFoundBefore) {
  SyntheticTracks scene = Scene(CameraPath::kArc, SyntheticTracksOptions::DefaultCamera());
  scene.file.camera = Guess(*scene.file.camera, 700.0);
  const Camera found = ReconstructWithCeres(scene.file).reconstruction.camera;
  for (const double factor : {1.0, 0.6}) {  // the right one, and one that was found wrong
    scene.file.found_camera = found;
    scene.file.found_camera->fx *= factor;
    scene.file.found_camera->fy *= factor;
    const MapperResult result = ReconstructWithCeres(scene.file);
    ASSERT_EQ(result.termination, MapperTermination::kSuccess) << result.summary.Brief();
    EXPECT_NEAR(result.reconstruction.camera.fx, found.fx, 0.005 * found.fx) << factor;
  }
}

TEST(LensChanges, AZoomIsFoundForEveryFrame) {
  SyntheticTracks scene = Scene(CameraPath::kForward, SyntheticTracksOptions::DefaultCamera());
  FocalScales zoom;  // by a fifth, at one rate
  for (std::size_t i = 0; i < scene.file.frames.size(); ++i) {
    zoom[scene.file.frames[i].index] = std::pow(1.2, static_cast<double>(i) / 39.0);
  }
  scene = test::Zoomed(std::move(scene), zoom);
  scene.file.camera->known = false;
  const MapperResult result = ReconstructWithCeres(scene.file);
  ASSERT_EQ(result.reconstruction.focal_scale.size(), zoom.size()) << result.summary.Brief();
  const FrameIndex first = scene.file.frames.front().index;
  for (const auto& [frame, scale] : zoom) {
    EXPECT_NEAR(CameraOf(result.reconstruction, frame).fx, 500.0 * scale, 15.0 * scale);
  }
  EXPECT_NEAR(FocalScaleOf(result.reconstruction.focal_scale, first), 1.0, 1e-9);
  EXPECT_TRUE(std::any_of(result.summary.reasons.begin(),
                          result.summary.reasons.end(),
                          [](const Doubt& d) { return d.code == DoubtCode::kFocalChanges; }))
      << "a zoom looks much like a way ahead, and that is said";

  // As `refine` does: a model that zooms goes on as one, with a camera that is refined or kept.
  for (const bool known : {false, true}) {
    Reconstruction start = result.reconstruction;
    start.camera.known = known;
    const MapperResult on = AdjustAndJudgeWithCeres(scene.file, start);
    ASSERT_EQ(on.reconstruction.focal_scale.size(), zoom.size()) << on.summary.Brief();
    for (const auto& [frame, scale] : zoom) {
      EXPECT_NEAR(CameraOf(on.reconstruction, frame).fx, 500.0 * scale, 15.0 * scale) << known;
    }
    EXPECT_LT(on.summary.mean_reprojection_px, 1.05 * result.summary.mean_reprojection_px) << known;
  }
}

// A window of the picture that moves, as that of a 2-D stabiliser.
TEST(LensChanges, APictureThatIsShiftedIsNamed) {
  SyntheticTracks scene = Scene(CameraPath::kArc, SyntheticTracksOptions::DefaultCamera());
  std::vector<Observation> observations;
  for (Observation o : scene.file.tracks.observations()) {
    o.xy.x() += 20.0 * std::sin(0.4 * ToInt(o.frame));
    observations.push_back(o);
  }
  scene.file.tracks = TrackSet::Build(std::move(observations));
  for (const bool known : {false, true}) {
    scene.file.camera->known = known;
    const MapperResult result = ReconstructWithCeres(scene.file);
    EXPECT_TRUE(std::any_of(result.summary.reasons.begin(),
                            result.summary.reasons.end(),
                            [](const Doubt& d) { return d.code == DoubtCode::kCenterMoves; }))
        << result.summary.Brief();
  }
}

TEST(LensChanges, OneCameraForAllFramesIsNoChange) {
  for (const CameraPath path : {CameraPath::kArc, CameraPath::kForward}) {
    SyntheticTracks scene = Scene(path, SyntheticTracksOptions::DefaultCamera());
    scene.file.camera->known = false;
    const MapperResult result = ReconstructWithCeres(scene.file);
    ASSERT_TRUE(result.lens_changes) << result.summary.Brief();
    EXPECT_FALSE(result.lens_changes->IsChanging());
    EXPECT_EQ(result.summary.Quality(), ModelQuality::kGood) << result.summary.Brief();
  }
}

TEST(CameraSearch, TellsAFisheyeFromAPinhole) {
  const Camera fisheye = test::FisheyeCamera();
  const auto found = Search(Scene(CameraPath::kForward, fisheye, 300), 1.2 * fisheye.width_px);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->camera.model, CameraModel::kFisheye);
  EXPECT_NEAR(found->camera.fx, fisheye.fx, 0.03 * fisheye.fx);

  Camera wide = SyntheticTracksOptions::DefaultCamera();
  wide.fx = wide.fy = 320.0;  // 90 degrees across
  const auto pinhole = Search(Scene(CameraPath::kForward, wide), 1.2 * wide.width_px);
  ASSERT_TRUE(pinhole);
  EXPECT_EQ(pinhole->camera.model, CameraModel::kPinhole);
  EXPECT_NEAR(pinhole->camera.fx, 320.0, 10.0);
}

// Of a narrow lens the tracks say nothing of k2, and the prior keeps it from running away.
TEST(CameraSearch, ANarrowLensKeepsCoefficientsThatMeanSomething) {
  Camera narrow = SyntheticTracksOptions::DefaultCamera();
  narrow.fx = narrow.fy = 2000.0;
  const auto found = Search(Scene(CameraPath::kArc, narrow), 1.2 * narrow.width_px);
  ASSERT_TRUE(found);
  // At the corner, r = 0.2, neither moves the picture by more than a few per cent.
  EXPECT_LT(std::abs(found->camera.k1) * 0.04, 0.03);
  EXPECT_LT(std::abs(found->camera.k2) * 0.0016, 0.03);
}

}  // namespace
}  // namespace cohort
