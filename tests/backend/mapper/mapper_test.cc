#include "backend/mapper/mapper.h"
#include "frontend/core/statistics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <numbers>

#include "backend/scene/near_world.h"
#include "frontend/core/error.h"
#include "frontend/core/interruption.h"
#include "frontend/core/random_stream.h"
#include "frontend/geometry/sim3.h"
#include "frontend/tracks/imported_tracks.h"
#include "tests/support/cameras.h"
#include "tests/support/synthetic_tracks.h"

namespace cohort {
namespace {

using test::AbsoluteTrajectoryError;
using test::CameraPath;
using test::MakeSyntheticTracks;
using test::SyntheticTracks;
using test::SyntheticTracksOptions;
using testing::Contains;
using testing::HasSubstr;

double Ate(const MapperResult& result, const SyntheticTracks& scene) {
  return AbsoluteTrajectoryError(result.reconstruction.cam_from_world, scene.cam_from_world);
}

SyntheticTracksOptions Scene(CameraPath path, double noise_px = 0.5) {
  SyntheticTracksOptions options;
  options.path = path;
  options.points = 150;
  options.noise_px = noise_px;
  return options;
}

// Why the model is doubtful, in one line.
std::string Doubts(const MapperResult& result) {
  return fmt::format("{}", fmt::join(SentencesOf(result.summary.reasons), "; "));
}

// Observations with the given change made to them.
template <typename Change>
TrackFile Changed(TrackFile file, const Change& change) {
  std::vector<Observation> observations;
  for (Observation o : file.tracks.observations()) {
    if (change(o)) observations.push_back(o);
  }
  file.tracks = TrackSet::Build(std::move(observations));
  return file;
}

TEST(IncrementalMapper, RecoversANoiseFreeScene) {
  for (const CameraPath path : {CameraPath::kArc, CameraPath::kLateral, CameraPath::kForward}) {
    const SyntheticTracks scene = MakeSyntheticTracks(Scene(path, 0.0));
    const MapperResult result = ReconstructWithCeres(scene.file);
    ASSERT_EQ(result.termination, MapperTermination::kSuccess) << result.summary.Brief();
    EXPECT_EQ(result.summary.registered, 24u);
    EXPECT_LT(Ate(result, scene), 1e-6);
  }
}

TEST(IncrementalMapper, SameTracksGiveTheSameBytes) {
  const SyntheticTracks scene = MakeSyntheticTracks(Scene(CameraPath::kArc));
  const MapperResult one = ReconstructWithCeres(scene.file);
  const MapperResult again = ReconstructWithCeres(scene.file);
  ASSERT_FALSE(one.reconstruction.cam_from_world.empty());
  for (const auto& [frame, pose] : one.reconstruction.cam_from_world) {
    EXPECT_EQ(pose.translation, again.reconstruction.cam_from_world.at(frame).translation);
  }
  for (const auto& [feature, point] : one.reconstruction.points) {
    EXPECT_EQ(point.in_world, again.reconstruction.points.at(feature).in_world);
  }
}

TEST(IncrementalMapper, EndsSoonWhereSomebodyInterruptsIt) {
  const SyntheticTracks scene = MakeSyntheticTracks(Scene(CameraPath::kArc));
  int checks = 0;
  {
    const InterruptionCheck check([&] {
      if (++checks == 3) ThrowError("enough");
    });
    EXPECT_THROW(ReconstructWithCeres(scene.file), Error);
  }
  EXPECT_EQ(checks, 3);
  EXPECT_EQ(ReconstructWithCeres(scene.file).termination, MapperTermination::kSuccess);
  EXPECT_EQ(checks, 3);
}

TEST(IncrementalMapper, CopesWithWrongAndMissingObservations) {
  for (const CameraPath path : {CameraPath::kArc, CameraPath::kLateral, CameraPath::kForward}) {
    SyntheticTracksOptions options = Scene(path, 1.0);
    options.frames = 40;
    options.outlier_fraction = 0.1;
    options.missing_fraction = 0.3;
    const SyntheticTracks scene = MakeSyntheticTracks(options);
    const MapperResult result = ReconstructWithCeres(scene.file);
    ASSERT_EQ(result.termination, MapperTermination::kSuccess) << result.summary.Brief();
    EXPECT_EQ(result.summary.registered, 40u);
    EXPECT_LT(Ate(result, scene), 0.015);
    // What is wrong by chance alone may be within the bound; not a tenth of it is.
    std::size_t kept = 0;
    for (const auto& [feature, point] : result.reconstruction.points) {
      for (const PointView& view : point.views) kept += scene.outliers.count({feature, view.frame});
    }
    EXPECT_LT(kept, scene.outliers.size() / 50);
    EXPECT_NEAR(result.noise, 1.0, 0.15);
  }
}

TEST(IncrementalMapper, ReconstructsANearlyPlanarScene) {
  SyntheticTracksOptions options = Scene(CameraPath::kLateral);
  options.plane_relief = 0.03;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  const MapperResult result = ReconstructWithCeres(scene.file);
  ASSERT_EQ(result.termination, MapperTermination::kSuccess) << result.summary.Brief();
  EXPECT_LT(Ate(result, scene), 0.02);
}

TEST(IncrementalMapper, NamesACameraThatDoesNotMoveOrOnlyTurns) {
  for (const double outliers : {0.0, 0.1}) {
    SyntheticTracksOptions options = Scene(CameraPath::kStatic);
    options.outlier_fraction = outliers;
    const MapperResult still = ReconstructWithCeres(MakeSyntheticTracks(options).file);
    EXPECT_EQ(still.termination, MapperTermination::kStaticCamera) << still.summary.termination;
    EXPECT_TRUE(still.reconstruction.cam_from_world.empty());
    EXPECT_THAT(still.summary.termination, HasSubstr("static camera: the picture moves by"));

    options.path = CameraPath::kRotation;
    SyntheticTracks turning = MakeSyntheticTracks(options);
    for (const bool known : {true, false}) {
      turning.file.camera->known = known;
      const MapperResult result = ReconstructWithCeres(turning.file);
      EXPECT_EQ(result.termination, MapperTermination::kPureRotation) << result.summary.termination;
      EXPECT_TRUE(result.reconstruction.cam_from_world.empty());
    }
  }
}

// Between the focal lengths that are tried.
TEST(IncrementalMapper, ACameraThatOnlyTurnsIsNeverTakenForGood) {
  SyntheticTracks turning = MakeSyntheticTracks(Scene(CameraPath::kRotation, 0.3));
  for (const double wrong : {0.92, 1.09}) {
    TrackFile file = turning.file;
    file.camera->known = false;
    file.camera->fx *= wrong;
    file.camera->fy *= wrong;
    const MapperResult result = ReconstructWithCeres(file);
    EXPECT_NE(result.summary.Quality(), ModelQuality::kGood) << result.summary.termination;
  }
}

// Points 4 to 9 before a camera of f = 500 px that goes sideways and turns by so many degrees a
// frame.
TrackFile StraightPath(double turn_deg) {
  RandomStream random(5, "test/mapper/straight");
  TrackFile file;
  file.width_px = 640;
  file.height_px = 480;
  Camera camera = SyntheticTracksOptions::DefaultCamera();
  std::vector<Observation> observations;
  for (std::uint32_t f = 0; f < 24; ++f) {
    file.frames.push_back({FrameIndex{f}, fmt::format("{}.png", f), 0});
  }
  for (std::uint32_t p = 0; p < 200; ++p) {
    const Eigen::Vector3d point(
        6.0 * random.Uniform() - 2.5, 4.0 * random.Uniform() - 2.0, 4.0 + 5.0 * random.Uniform());
    for (std::uint32_t f = 0; f < 24; ++f) {
      const Eigen::Quaterniond turn(
          Eigen::AngleAxisd(f * turn_deg * std::numbers::pi / 180.0, Eigen::Vector3d::UnitY()));
      const auto xy = camera.Project(turn * (point - Eigen::Vector3d(0.05 * f, 0.0, 0.0)));
      if (!xy || !IsInPicture(*xy, 640, 480)) continue;
      const Eigen::Vector2d noise(random.Gaussian(), random.Gaussian());
      observations.push_back(
          {.feature = FeatureId{p}, .frame = FrameIndex{f}, .xy = *xy + 0.2 * noise});
    }
  }
  camera.known = false;
  camera.fx = camera.fy = 650.0;
  file.camera = camera;
  file.tracks = TrackSet::Build(std::move(observations));
  return file;
}

// Of a path without a turn all focal lengths fit, each with depths of its own.
TEST(IncrementalMapper, SaysWhenTheFocalLengthIsAsGoodAsUnknown) {
  MapperOptions options;
  options.covariances = true;
  const MapperResult straight = ReconstructWithCeres(StraightPath(0.0), options);
  EXPECT_EQ(straight.summary.termination, "success") << "doubts are reasons";
  EXPECT_THAT(Doubts(straight), HasSubstr("the focal length is known only to within"));
  ASSERT_FALSE(straight.summary.reasons.empty());
  EXPECT_EQ(straight.summary.reasons.front().code, DoubtCode::kFocalUncertain);
  EXPECT_THAT(straight.summary.reasons.front().figures,
              testing::ElementsAre(testing::Pair("focal_sigma", testing::Gt(0.05))));
  const MapperResult turned = ReconstructWithCeres(StraightPath(1.0), options);
  EXPECT_THAT(turned.summary.reasons,
              testing::Not(Contains(testing::Field(&Doubt::code, DoubtCode::kFocalUncertain))));
  EXPECT_NEAR(turned.reconstruction.camera.fx, 500.0, 15.0);
}

TEST(IncrementalMapper, SaysWhenAReadoutChangesNothing) {
  SyntheticTracksOptions scene = Scene(CameraPath::kArc);
  MapperOptions options;
  options.readout = 0.5;
  EXPECT_TRUE(ReconstructWithCeres(MakeSyntheticTracks(scene).file, options).warnings.empty());
  scene.frame_stride = 4;
  EXPECT_THAT(ReconstructWithCeres(MakeSyntheticTracks(scene).file, options).warnings,
              testing::ElementsAre(HasSubstr("the readout of 0.5 has no effect")));
}

// What looks like parallax is each track's own drift: no model without a doubt of it.
TEST(IncrementalMapper, TracksThatDriftGiveNoGoodModelWhereTheCameraHasNoParallax) {
  for (const CameraPath path : {CameraPath::kStatic, CameraPath::kRotation}) {
    for (const double drift_px : {0.2, 0.5}) {
      SyntheticTracksOptions options = Scene(path, 0.3);
      options.frames = 60;
      options.drift_px = drift_px;
      const MapperResult result = ReconstructWithCeres(MakeSyntheticTracks(options).file);
      EXPECT_NE(result.summary.Quality(), ModelQuality::kGood) << result.summary.Brief();
      if (result.summary.Quality() == ModelQuality::kDoubtful) {
        EXPECT_THAT(SentencesOf(result.summary.reasons),
                    Contains(HasSubstr("parallax is unexplained")));
      } else {
        EXPECT_THAT(result.summary.termination, HasSubstr("they drift, or lie on moving objects"));
      }
    }
  }
  SyntheticTracksOptions options = Scene(CameraPath::kLateral, 0.3);
  options.frames = 60;
  options.drift_px = 0.3;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  const MapperResult result = ReconstructWithCeres(scene.file);
  ASSERT_EQ(result.termination, MapperTermination::kSuccess) << result.summary.Brief();
  EXPECT_LT(Ate(result, scene), 0.05);
}

// Slowly ahead: most points are seen at less than half a degree, and who waits for more than that
// breaks off after 15 and 21 frames.
TEST(IncrementalMapper, SmallStepsAheadThroughShortTracksStayInOnePiece) {
  for (const double path_length : {0.5, 1.0}) {
    SCOPED_TRACE(path_length);
    SyntheticTracksOptions options = Scene(CameraPath::kForward, 1.0);
    options.frames = 50;
    options.path_length = path_length;
    options.points = 4000;
    options.max_track_length = 5;
    options.drift_px = 0.2;
    options.outlier_fraction = 0.1;
    const SyntheticTracks scene = MakeSyntheticTracks(options);
    const MapperResult result = ReconstructWithCeres(scene.file);
    ASSERT_EQ(result.summary.registered, 50u) << result.summary.Brief();
    // Of the shorter path, four seeds give 5 to 14 %.
    EXPECT_LT(Ate(result, scene), 0.1 * 2.5 * path_length);
  }
}

TEST(IncrementalMapper, WeighsObservationsByTheirCovariance) {
  // Half of the features are measured five times worse than the others, and say so.
  double plain = 0.0;
  double weighed = 0.0;
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    SyntheticTracksOptions options = Scene(CameraPath::kArc, 0.3);
    options.seed = seed;
    const SyntheticTracks scene = MakeSyntheticTracks(options);
    RandomStream noise(seed, "incremental_mapper_test");
    const TrackFile file = Changed(scene.file, [&](Observation& o) {
      const bool bad = (ToInt(o.feature) / 3) % 2 == 1;
      if (bad) o.xy += 1.5 * Eigen::Vector2d(noise.Gaussian(), noise.Gaussian());
      const float variance = bad ? 2.34F : 0.09F;
      o.covariance = PixelCovariance{variance, 0.0F, variance};
      return true;
    });
    MapperOptions mapper;
    mapper.whitening.covariance_floor_px = 0.0;
    const MapperResult with = ReconstructWithCeres(file, mapper);
    EXPECT_NEAR(with.noise, 1.0, 0.1);
    weighed += Ate(with, scene);
    mapper.whitening.use_covariances = false;
    plain += Ate(ReconstructWithCeres(file, mapper), scene);
  }
  EXPECT_LT(weighed, 0.9 * plain);
}

TEST(IncrementalMapper, PredictedPositionsAreNotUsed) {
  const SyntheticTracks scene = MakeSyntheticTracks(Scene(CameraPath::kArc, 0.3));
  const TrackFile file = Changed(scene.file, [&](Observation& o) {
    if (ToInt(o.frame) % 3 == 1) {  // 2 px off, all to the right
      o.state = ObservationState::kPredicted;
      o.xy.x() += 2.0;
    }
    return true;
  });
  const MapperResult result = ReconstructWithCeres(file);
  EXPECT_EQ(result.summary.registered, 16u);  // the other frames have no observation
  for (const auto& [feature, point] : result.reconstruction.points) {
    for (const PointView& view : point.views) EXPECT_NE(ToInt(view.frame) % 3, 1u);
  }
}

TEST(IncrementalMapper, RefinesAGuessedFocalLengthAndDistortion) {
  for (const double wrong : {0.7, 1.3}) {
    SyntheticTracksOptions options = Scene(CameraPath::kArc);
    options.frames = 40;
    SyntheticTracks scene = MakeSyntheticTracks(options);
    scene.file.camera->known = false;
    scene.file.camera->fx *= wrong;
    scene.file.camera->fy *= wrong;
    const MapperResult result = ReconstructWithCeres(scene.file);
    ASSERT_EQ(result.termination, MapperTermination::kSuccess) << result.summary.Brief();
    EXPECT_NEAR(result.reconstruction.camera.fx, 500.0, 15.0) << "guessed as " << 500.0 * wrong;
    EXPECT_LT(Ate(result, scene), 0.03);
  }
}

// Where it ends does not depend on what else was asked for, and going on from there goes nowhere.
TEST(IncrementalMapper, EndsAtTheOptimumOfAGuessedCamera) {
  SyntheticTracksOptions options = Scene(CameraPath::kArc);
  options.frames = 40;
  SyntheticTracks scene = MakeSyntheticTracks(options);
  scene.file.camera->known = false;
  scene.file.camera->fx *= 1.3;
  scene.file.camera->fy *= 1.3;
  const MapperResult result = ReconstructWithCeres(scene.file);
  const MapperResult with = ReconstructWithCeres(scene.file, {.covariances = true});
  EXPECT_EQ(with.reconstruction.camera.fx, result.reconstruction.camera.fx);
  EXPECT_FALSE(with.camera_covariances.empty());
  const MapperResult on = AdjustAndJudgeWithCeres(scene.file, result.reconstruction);
  EXPECT_NEAR(on.reconstruction.camera.fx, result.reconstruction.camera.fx, 0.1);
  EXPECT_NEAR(on.reconstruction.camera.k1, result.reconstruction.camera.k1, 1e-3);
}

// A draft ends where the condensed adjustment does, a model at the minimum of all.
TEST(IncrementalMapper, EndsAtTheOptimumOfAKnownCamera) {
  SyntheticTracksOptions options = Scene(CameraPath::kArc, 0.5);
  options.frames = 60;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  const auto moves_on = [&](const MapperResult& result) {
    const MapperResult on = AdjustAndJudgeWithCeres(scene.file, result.reconstruction);
    return test::AbsoluteTrajectoryError(on.reconstruction.cam_from_world,
                                         result.reconstruction.cam_from_world);
  };
  const double draft = moves_on(ReconstructWithCeres(scene.file, {.draft = true}));
  EXPECT_LT(moves_on(ReconstructWithCeres(scene.file)), 0.2 * draft);
}

// As good as with a lens that does not distort.
TEST(IncrementalMapper, KnownLensesOfAllModelsAreTakenForWhatTheyAre) {
  for (const Camera& camera :
       {test::FreiburgCamera(), test::RationalCamera(), test::FisheyeCamera()}) {
    for (const CameraPath path : {CameraPath::kArc, CameraPath::kLateral}) {
      SyntheticTracksOptions options = Scene(path, 0.1);
      options.camera = camera;
      const SyntheticTracks scene = MakeSyntheticTracks(options);
      const MapperResult result = ReconstructWithCeres(scene.file);
      ASSERT_EQ(result.termination, MapperTermination::kSuccess) << result.summary.Brief();
      EXPECT_EQ(result.summary.Quality(), ModelQuality::kGood) << result.summary.Brief();
      EXPECT_LT(Ate(result, scene), 0.02);
      EXPECT_NEAR(result.noise, 0.1, 0.02);
      EXPECT_EQ(result.reconstruction.camera.k3, camera.k3);
    }
  }
}

TEST(IncrementalMapper, SaysWhenTheTracksContradictAKnownCamera) {
  // A focal length that is wrong by 30 %.
  SyntheticTracks scene = MakeSyntheticTracks(Scene(CameraPath::kArc));
  EXPECT_FALSE(ReconstructWithCeres(scene.file).better_camera);
  scene.file.camera->fx = scene.file.camera->fy = 650.0;
  const MapperResult focal = ReconstructWithCeres(scene.file);
  ASSERT_TRUE(focal.better_camera) << focal.summary.Brief();
  EXPECT_NEAR(focal.better_camera->fx, 500.0, 60.0);
  EXPECT_THAT(Doubts(focal), HasSubstr("the tracks contradict the given camera"));
  // A distorted camera without its coefficients.
  SyntheticTracksOptions options = Scene(CameraPath::kArc, 0.3);
  options.camera.k1 = -0.25;
  scene = MakeSyntheticTracks(options);
  scene.file.camera->k1 = 0.0;
  const MapperResult distorted = ReconstructWithCeres(scene.file);
  ASSERT_TRUE(distorted.better_camera) << distorted.summary.Brief();
  EXPECT_NEAR(distorted.better_camera->k1, -0.25, 0.1);
}

TEST(IncrementalMapper, SaysWhenTheModelLeavesMoreThanTheTracksNoise) {
  SyntheticTracksOptions options = Scene(CameraPath::kArc, 0.1);
  options.frames = 60;
  EXPECT_EQ(ReconstructWithCeres(MakeSyntheticTracks(options).file).summary.termination, "success");
  options.drift_px = 0.4;
  const MapperResult result = ReconstructWithCeres(MakeSyntheticTracks(options).file);
  ASSERT_EQ(result.termination, MapperTermination::kSuccess);
  EXPECT_THAT(Doubts(result),
              testing::AllOf(HasSubstr("the residual noise of the model is 0."),
                             HasSubstr("the tracks drift or lie on moving objects")));
}

TEST(IncrementalMapper, AClipThatBreaksHasTwoParts) {
  SyntheticTracksOptions options = Scene(CameraPath::kArc);
  options.frames = 40;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  // After frame 25 nothing is the feature that it was.
  const TrackFile file = Changed(scene.file, [](Observation& o) {
    if (ToInt(o.frame) > 25) o.feature = FeatureId{ToInt(o.feature) + 100'000};
    return true;
  });
  const MapperResult result = ReconstructWithCeres(file);
  EXPECT_EQ(result.termination, MapperTermination::kPartial);
  EXPECT_EQ(result.summary.registered, 26u);
  EXPECT_LT(Ate(result, scene), 0.02);
  ASSERT_EQ(result.other_parts.size(), 1u);
  const auto& poses = result.other_parts[0].cam_from_world;
  EXPECT_EQ(poses.begin()->first, FrameIndex{26});
  EXPECT_EQ(poses.rbegin()->first, FrameIndex{39});
  EXPECT_EQ(poses.size(), 14u);
  EXPECT_EQ(result.summary.termination, "partial");
  EXPECT_THAT(Doubts(result), HasSubstr("breaks into 2 parts"));
}

// As a thing that is turned before a wall, and the wall: the camera moves past either in its way.
TEST(IncrementalMapper, OfTwoBodiesTheOneOfMostObservationsIsTheScene) {
  constexpr int kShort = 8;  // frames of the other body, which has more tracks in them
  SyntheticTracksOptions options = Scene(CameraPath::kArc);
  options.points = 200;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  options.path = CameraPath::kLateral;
  options.points = 350;
  options.seed = 2;
  const SyntheticTracks other = MakeSyntheticTracks(options);

  std::vector<Observation> observations(scene.file.tracks.observations().begin(),
                                        scene.file.tracks.observations().end());
  for (Observation o : other.file.tracks.observations()) {
    if (ToInt(o.frame) >= kShort) continue;
    o.feature = FeatureId{ToInt(o.feature) + 100'000};
    observations.push_back(o);
  }
  TrackFile file = scene.file;
  file.tracks = TrackSet::Build(std::move(observations));

  const MapperResult result = ReconstructWithCeres(file);
  ASSERT_EQ(result.termination, MapperTermination::kSuccess) << result.summary.Brief();
  EXPECT_EQ(result.summary.registered, 24u);
  EXPECT_LT(Ate(result, scene), 0.04);
  for (const auto& [feature, point] : result.reconstruction.points) {
    if (point.views.size() > kShort) {
      EXPECT_LT(ToInt(feature), 100'000u);
    }
  }
}

TEST(IncrementalMapper, TracksThatNeverTriangulateAreNamed) {
  const SyntheticTracks scene = MakeSyntheticTracks(Scene(CameraPath::kArc));
  RandomStream random(1, "incremental_mapper_test");
  // Feature 5 jumps about; of feature 8 one position is left.
  const TrackFile file = Changed(scene.file, [&](Observation& o) {
    if (o.feature == FeatureId{5}) o.xy = {random.Uniform(0, 639), random.Uniform(0, 479)};
    return o.feature != FeatureId{8} || ToInt(o.frame) == 3;
  });
  const MapperResult result = ReconstructWithCeres(file);
  EXPECT_THAT(result.without_point, testing::IsSupersetOf({FeatureId{5}, FeatureId{8}}));
  EXPECT_EQ(result.without_point.size() + result.summary.points, file.tracks.features().size());
}

TEST(IncrementalMapper, CovariancesOfCamerasAndPointsFitTheErrors) {
  const SyntheticTracks scene = MakeSyntheticTracks(Scene(CameraPath::kLateral));
  MapperOptions options;
  options.covariances = true;
  const MapperResult result = ReconstructWithCeres(scene.file, options);
  ASSERT_EQ(result.camera_covariances.size(), 24u);
  ASSERT_EQ(result.point_covariances.size(), result.summary.points);
  std::vector<double> ratios;
  for (const auto& [feature, covariance] : result.point_covariances) {
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(covariance);
    EXPECT_GT(eigen.eigenvalues()[0], 0.0);
    // Depth is the least certain direction: along the ray, nearly.
    const Eigen::Vector3d ray = result.reconstruction.points.at(feature).in_world.normalized();
    ratios.push_back(std::abs(ray.dot(eigen.eigenvectors().col(2))));
  }
  std::nth_element(ratios.begin(), ratios.begin() + ratios.size() / 2, ratios.end());
  EXPECT_GT(ratios[ratios.size() / 2], 0.95);
}

TEST(IncrementalMapper, SaysWhatIsMissing) {
  const SyntheticTracks scene = MakeSyntheticTracks(Scene(CameraPath::kArc));
  const auto expect = [](const TrackFile& file, const std::string& text) {
    const MapperResult result = ReconstructWithCeres(file);
    EXPECT_EQ(result.termination, MapperTermination::kTooFewTracks);
    EXPECT_TRUE(result.reconstruction.cam_from_world.empty());
    EXPECT_THAT(result.summary.termination, HasSubstr(text));
    EXPECT_EQ(result.summary.termination.find('\n'), std::string::npos);
  };
  expect(Changed(scene.file, [](Observation&) { return false; }), "none of 0 tracks");
  expect(Changed(scene.file,  // every track has one position
                 [](Observation& o) { return ToInt(o.frame) == (ToInt(o.feature) / 3) % 24; }),
         "tracks is observed in 3 frames");
  TrackFile one_frame = Changed(scene.file, [](Observation& o) { return ToInt(o.frame) == 0; });
  one_frame.frames.resize(1);
  expect(one_frame, "the clip has 1 frame, at least 3 are needed");
  expect(Changed(scene.file, [](Observation& o) { return ToInt(o.feature) < 30; }),
         "no two keyframes that were tried share 12 tracks");

  TrackFile broken = scene.file;
  broken.camera->fx = 0.0;
  EXPECT_THAT([&] { ReconstructWithCeres(broken); }, testing::Throws<Error>());
  broken = scene.file;
  broken.camera->cx = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT([&] { ReconstructWithCeres(broken); }, testing::Throws<Error>());
}

// Two frames have no third to check a point, but a model.
TEST(IncrementalMapper, ReconstructsTwoFrames) {
  SyntheticTracksOptions options = Scene(CameraPath::kLateral, 0.2);
  options.frames = 2;
  options.points = 300;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  MapperOptions mapper;
  mapper.whitening.min_track_length = 2;
  const MapperResult result = ReconstructWithCeres(scene.file, mapper);
  EXPECT_EQ(result.summary.registered, 2u) << result.summary.Brief();
  EXPECT_GT(result.summary.points, 100u);
}

// Of tracks that claim to be exact and are not.
TEST(IncrementalMapper, WithoutAFloorOfTheDeviationsItEnds) {
  SyntheticTracks scene = MakeSyntheticTracks(Scene(CameraPath::kArc));
  scene.file = Changed(scene.file, [](Observation& o) {
    o.covariance = PixelCovariance{1e-7F, 0.0F, 1e-7F};
    return true;
  });
  const MapperResult result =
      ReconstructWithCeres(scene.file, {.whitening = {.covariance_floor_px = 0.0}});
  EXPECT_GT(result.noise, 1000.0) << result.summary.Brief();
  EXPECT_EQ(result.summary.registered, 24u) << result.summary.Brief();
}

// Worlds of georeferenced models, in metres from a corner of the country, and in units of
// anybody's.
class WorldsAnywhere : public testing::TestWithParam<Sim3> {
 protected:
  WorldsAnywhere() : scene_(MakeSyntheticTracks(Scene(CameraPath::kArc))) {
    Reconstruction truth;
    truth.camera = *scene_.file.camera;
    truth.cam_from_world = scene_.cam_from_world;
    for (const auto& [feature, point] : scene_.points_in_world) {
      truth.points[feature].in_world = point;
    }
    here_ = truth;
    there_ = MoveWorld(GetParam(), truth);
  }

  // Nearly all of the points, at their places to within what the noise makes here.
  void ExpectThere(const Reconstruction& model) const {
    EXPECT_EQ(model.cam_from_world.size(), scene_.cam_from_world.size());
    EXPECT_GT(model.points.size(), scene_.points_in_world.size() * 9 / 10);
    std::vector<double> errors;
    for (const auto& [feature, point] : model.points) {
      errors.push_back((point.in_world - there_.points.at(feature).in_world).norm());
    }
    EXPECT_LT(Median(errors), 0.05 * GetParam().scale);
  }

  SyntheticTracks scene_;
  Reconstruction here_;
  Reconstruction there_;
};

TEST_P(WorldsAnywhere, AdjustmentKeepsThePointsAndTheWorld) {
  ExpectThere(AdjustWithCeres(scene_.file, there_));
}

TEST_P(WorldsAnywhere, AModelAdjustedToTheEndIsTheSame) {
  const Reconstruction there = AdjustAndJudgeWithCeres(scene_.file, there_).reconstruction;
  const Reconstruction here = AdjustAndJudgeWithCeres(scene_.file, here_).reconstruction;
  ASSERT_EQ(there.points.size(), here.points.size());
  for (const auto& [feature, point] : there.points) {
    EXPECT_LT((point.in_world - here.points.at(feature).in_world).norm(), 1e-3);
  }
}

TEST_P(WorldsAnywhere, TriangulationFindsThePoints) {
  const MapperResult result = TriangulateWithCeres(scene_.file, there_.cam_from_world);
  ExpectThere(result.reconstruction);
  for (const auto& [frame, pose] : result.reconstruction.cam_from_world) {
    EXPECT_EQ(pose.translation, there_.cam_from_world.at(frame).translation);
  }
}

INSTANTIATE_TEST_SUITE_P(
    FarTinyAndHuge,
    WorldsAnywhere,
    testing::Values(Sim3{},
                    Sim3{1.0, Eigen::Quaterniond::Identity(), {5e5, 1e5, 4.5e5}},
                    Sim3{1.0, Eigen::Quaterniond::Identity(), {4e6, 8e5, 3.6e6}},
                    Sim3{1e-7, Eigen::Quaterniond::Identity(), {0.0, 0.0, 0.0}},
                    Sim3{1e13, Eigen::Quaterniond::Identity(), {0.0, 0.0, 0.0}}));

TEST(TriangulateWithCeres, KeepsThePosesAndFindsThePoints) {
  test::SyntheticTracksOptions options;
  options.outlier_fraction = 0.05;
  const test::SyntheticTracks tracks = test::MakeSyntheticTracks(options);
  const MapperResult result = TriangulateWithCeres(tracks.file, tracks.cam_from_world);
  EXPECT_EQ(result.termination, MapperTermination::kSuccess);
  EXPECT_EQ(result.summary.registered, tracks.file.frames.size());
  EXPECT_GT(result.reconstruction.points.size(), tracks.points_in_world.size() * 9 / 10);
  for (const auto& [frame, pose] : result.reconstruction.cam_from_world) {
    EXPECT_EQ(pose.translation, tracks.cam_from_world.at(frame).translation);
  }
  std::vector<double> errors;
  for (const auto& [feature, point] : result.reconstruction.points) {
    errors.push_back((point.in_world - tracks.points_in_world.at(feature)).norm());
  }
  EXPECT_LT(Median(errors), 0.01);
}

// From cameras that stand at one place no point has a depth. That they have a pose is no success.
TEST(TriangulateWithCeres, WithoutAnyPointFails) {
  const test::SyntheticTracks tracks = test::MakeSyntheticTracks({});
  std::map<FrameIndex, Rigid3> standing = tracks.cam_from_world;
  for (auto& [frame, pose] : standing) pose = tracks.cam_from_world.begin()->second;
  const MapperResult result = TriangulateWithCeres(tracks.file, standing);
  ASSERT_TRUE(result.reconstruction.points.empty());
  EXPECT_EQ(result.summary.registered, tracks.file.frames.size());
  EXPECT_TRUE(result.summary.Failed());
  EXPECT_EQ(result.summary.WhyFailed(), "the model has no points");
  EXPECT_EQ(result.termination, MapperTermination::kPartial);
}

}  // namespace
}  // namespace cohort
