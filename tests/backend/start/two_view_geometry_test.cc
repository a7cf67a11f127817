#include "backend/start/two_view_geometry.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <numbers>

#include "tests/support/synthetic_tracks.h"

namespace cohort {
namespace {

using test::CameraPath;
using test::MakeSyntheticTracks;
using test::SyntheticTracks;
using test::SyntheticTracksOptions;

constexpr double kDegrees = 180.0 / std::numbers::pi;

struct PairResult {
  TwoViewGeometry geometry;
  double rotation_error_deg = 180.0;
  double direction_error_deg = 180.0;
  std::size_t true_inliers_lost = 0;
  std::size_t outliers_kept = 0;
};

PairResult EstimatePair(const SyntheticTracks& scene, std::uint32_t frame1, std::uint32_t frame2) {
  const FrameIndex f1{frame1};
  const FrameIndex f2{frame2};
  const FramePairMatches matches = MatchFrames(scene.file.tracks, f1, f2);
  PairResult result;
  result.geometry = EstimateTwoViewGeometry(matches.xy1, matches.xy2, *scene.file.camera);
  for (std::size_t i = 0; i < matches.features.size(); ++i) {
    const bool outlier = scene.outliers.contains({matches.features[i], f1}) ||
                         scene.outliers.contains({matches.features[i], f2});
    if (outlier && result.geometry.inlier[i]) ++result.outliers_kept;
    if (!outlier && !result.geometry.inlier[i]) ++result.true_inliers_lost;
  }
  if (result.geometry.cam2_from_cam1) {
    const Rigid3 truth = scene.cam_from_world.at(f2) * scene.cam_from_world.at(f1).Inverse();
    const Rigid3& pose = *result.geometry.cam2_from_cam1;
    result.rotation_error_deg = AngleBetween(pose.rotation, truth.rotation) * kDegrees;
    result.direction_error_deg =
        std::acos(std::clamp(pose.translation.dot(truth.translation.normalized()), -1.0, 1.0)) *
        kDegrees;
  }
  return result;
}

TEST(TwoViewGeometry, FindsTheTruePoseWithoutNoise) {
  for (const auto path : {CameraPath::kArc, CameraPath::kLateral, CameraPath::kForward}) {
    SyntheticTracksOptions options;
    options.path = path;
    options.noise_px = 0.0;
    const PairResult r = EstimatePair(MakeSyntheticTracks(options), 2, 17);
    EXPECT_EQ(r.geometry.kind, TwoViewKind::kCalibrated);
    EXPECT_LT(r.rotation_error_deg, 1e-5);
    EXPECT_LT(r.direction_error_deg, 1e-4);
    EXPECT_EQ(r.true_inliers_lost, 0u);
    EXPECT_NEAR(r.geometry.cam2_from_cam1->translation.norm(), 1.0, 1e-9);
  }
}

TEST(TwoViewGeometry, RejectsAThirdOfFalseMatches) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SyntheticTracksOptions options;
    options.noise_px = 0.5;
    options.outlier_fraction = 0.18;  // of observations: 33 % of pairs
    options.seed = seed;
    const PairResult r = EstimatePair(MakeSyntheticTracks(options), 2, 17);
    EXPECT_EQ(r.geometry.kind, TwoViewKind::kCalibrated);
    EXPECT_LT(r.rotation_error_deg, 0.3) << "seed " << seed;
    EXPECT_LT(r.direction_error_deg, 1.5) << "seed " << seed;
    EXPECT_LE(r.true_inliers_lost, 2u) << "seed " << seed;
    EXPECT_LE(r.outliers_kept, 8u) << "seed " << seed;
  }
}

TEST(TwoViewGeometry, WorksWithFewMatchesAndWithDistortion) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    SyntheticTracksOptions options;
    options.points = 22;
    options.noise_px = 0.3;
    options.outlier_fraction = 0.05;
    options.camera.k1 = -0.25;
    options.camera.k2 = 0.05;
    options.camera.p1 = 0.002;
    options.seed = seed;
    const PairResult r = EstimatePair(MakeSyntheticTracks(options), 1, 20);
    EXPECT_EQ(r.geometry.kind, TwoViewKind::kCalibrated) << "seed " << seed;
    EXPECT_LT(r.rotation_error_deg, 1.0) << "seed " << seed;
    EXPECT_LT(r.direction_error_deg, 5.0) << "seed " << seed;
  }
}

TEST(TwoViewGeometry, MeasuresTheTriangulationAngle) {
  SyntheticTracksOptions options;
  options.noise_px = 0.0;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  const PairResult r = EstimatePair(scene, 0, 23);
  EXPECT_NEAR(r.geometry.angle_deg, 40.0, 4.0);  // the arc spans 40 degrees about the points
}

TEST(TwoViewGeometry, TellsPlaneRotationAndStandstillApart) {
  for (const double noise_px : {0.1, 0.5, 1.0}) {
    SyntheticTracksOptions options;
    options.noise_px = noise_px;
    options.outlier_fraction = 0.05;
    options.path = CameraPath::kRotation;
    const PairResult turned = EstimatePair(MakeSyntheticTracks(options), 2, 17);
    EXPECT_EQ(turned.geometry.kind, TwoViewKind::kPanoramic) << noise_px;
    EXPECT_GT(turned.geometry.motion_px, 50.0);
    EXPECT_LE(turned.outliers_kept, 2u);

    options.path = CameraPath::kStatic;
    const PairResult still = EstimatePair(MakeSyntheticTracks(options), 2, 17);
    EXPECT_EQ(still.geometry.kind, TwoViewKind::kPanoramic) << noise_px;
    EXPECT_LT(still.geometry.motion_px, 4.0 * noise_px);

    options.path = CameraPath::kArc;
    options.plane_relief = 0.0;
    const PairResult plane = EstimatePair(MakeSyntheticTracks(options), 2, 17);
    EXPECT_EQ(plane.geometry.kind, TwoViewKind::kPlanar) << noise_px;
    EXPECT_GT(plane.geometry.homography_ratio, 0.95);
  }
}

TEST(TwoViewGeometry, KeepsToTheFundamentalMatrixWhileTheFocalLengthIsAGuess) {
  SyntheticTracksOptions options;
  options.outlier_fraction = 0.1;
  SyntheticTracks scene = MakeSyntheticTracks(options);
  scene.file.camera = Camera::Guess(640, 480);  // f = 768 for a true 500
  const PairResult r = EstimatePair(scene, 2, 17);
  EXPECT_EQ(r.geometry.kind, TwoViewKind::kUncalibrated);
  EXPECT_TRUE(r.geometry.fundamental.has_value());
  EXPECT_LE(r.true_inliers_lost, 2u);
  EXPECT_LE(r.outliers_kept, 8u);
}

TEST(TwoViewGeometry, MatricesAgreeWithTheConventionX2FX1) {
  SyntheticTracksOptions options;
  options.noise_px = 0.0;
  options.plane_relief = 0.0;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  const auto matches = MatchFrames(scene.file.tracks, FrameIndex{2}, FrameIndex{17});
  const auto g = EstimateTwoViewGeometry(matches.xy1, matches.xy2, *scene.file.camera);
  ASSERT_TRUE(g.fundamental && g.essential && g.homography);
  for (std::size_t i = 0; i < matches.xy1.size(); ++i) {
    const Eigen::Vector3d x1 = matches.xy1[i].homogeneous();
    const Eigen::Vector3d x2 = matches.xy2[i].homogeneous();
    const Eigen::Vector3d line = *g.fundamental * x1;
    EXPECT_LT(std::abs(x2.dot(line)) / line.head<2>().norm(), 0.01);
    EXPECT_LT(((*g.homography * x1).hnormalized() - x2.hnormalized()).norm(), 0.01);
  }
}

TEST(TwoViewGeometry, IsDegenerateWithTooFewMatchesOrWithNoiseAlone) {
  SyntheticTracksOptions options;
  options.points = 10;
  EXPECT_EQ(EstimatePair(MakeSyntheticTracks(options), 2, 17).geometry.kind,
            TwoViewKind::kDegenerate);
  EXPECT_EQ(EstimateTwoViewGeometry({}, {}, options.camera).kind, TwoViewKind::kDegenerate);
  const std::vector<Eigen::Vector2d> same(40, Eigen::Vector2d(100, 100));
  EXPECT_NE(EstimateTwoViewGeometry(same, same, options.camera).kind, TwoViewKind::kCalibrated);
}

TEST(TwoViewGeometry, RepeatsExactly) {
  SyntheticTracksOptions options;
  options.outlier_fraction = 0.1;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  const PairResult a = EstimatePair(scene, 2, 17);
  const PairResult b = EstimatePair(scene, 2, 17);
  EXPECT_EQ(a.geometry.inlier, b.geometry.inlier);
  EXPECT_EQ(a.geometry.cam2_from_cam1->translation, b.geometry.cam2_from_cam1->translation);
}

TEST(MatchFrames, LeavesPredictedPositionsOut) {
  const auto at = [](std::uint32_t feature, std::uint32_t frame, ObservationState state) {
    Observation o;
    o.feature = FeatureId{feature};
    o.frame = FrameIndex{frame};
    o.state = state;
    return o;
  };
  constexpr auto kSeen = ObservationState::kObserved;
  const TrackSet tracks = TrackSet::Build(
      {at(1, 0, kSeen), at(1, 4, kSeen), at(2, 0, ObservationState::kPredicted), at(2, 4, kSeen)});
  EXPECT_THAT(MatchFrames(tracks, FrameIndex{0}, FrameIndex{4}).features,
              testing::ElementsAre(FeatureId{1}));
}

}  // namespace
}  // namespace cohort
