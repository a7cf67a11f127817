#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/resource.h>

#include <csignal>
#include <cstring>
#include <limits>

#include "backend/colmap/database.h"
#include "backend/colmap/tracks_to_database.h"
#include "backend/scene/reprojection.h"
#include "frontend/storage/output.h"
#include "frontend/storage/sqlite.h"
#include "tests/support/cameras.h"
#include "tests/support/synthetic_tracks.h"
#include "tests/support/temp_dir.h"
#include "tests/support/zoom.h"

namespace cohort {
namespace {

using test::CameraPath;
using test::MakeSyntheticTracks;
using test::SyntheticTracks;
using test::SyntheticTracksOptions;
using test::TempDir;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

SqliteDatabase Open(const std::filesystem::path& path) {
  return SqliteDatabase::Open(path, SqliteDatabase::Mode::kCreate);
}

std::vector<std::string> Columns(SqliteDatabase& db, const std::string& table) {
  std::vector<std::string> columns;
  auto select = db.Prepare("SELECT name FROM pragma_table_info(?) ORDER BY cid");
  select.Bind(1, table);
  while (select.Step()) columns.emplace_back(select.Text(0));
  return columns;
}

template <typename T>
std::vector<T> As(std::span<const std::byte> bytes) {
  std::vector<T> values(bytes.size() / sizeof(T));
  std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
  return values;
}

Observation At(std::uint32_t feature,
               std::uint32_t frame,
               double x,
               double y,
               ObservationState state = ObservationState::kObserved) {
  Observation o;
  o.feature = FeatureId{feature};
  o.frame = FrameIndex{frame};
  o.xy = {x, y};
  o.state = state;
  return o;
}

TrackFile ThreeFrames() {
  TrackFile file;
  file.width_px = 640;
  file.height_px = 480;
  file.camera = SyntheticTracksOptions::DefaultCamera();
  file.frames = {
      {FrameIndex{0}, "a/0.png", 0}, {FrameIndex{1}, "a/1.png", 1}, {FrameIndex{2}, "a/2.png", 2}};
  file.tracks = TrackSet::Build({At(4, 0, 10.25, 20.5),
                                 At(9, 0, 0, 0),
                                 At(9, 1, 1, 2),
                                 At(5, 1, 3, 4, ObservationState::kPredicted)});
  return file;
}

TEST(ColmapDatabase, HasTheSchemaOf38InColumnOrder) {
  const TempDir dir;
  WriteColmapDatabase(dir / "a.db", ThreeFrames());
  auto db = Open(dir / "a.db");
  EXPECT_EQ(db.UserVersion(), 3800);
  EXPECT_THAT(Columns(db, "cameras"),
              ElementsAre("camera_id", "model", "width", "height", "params", "prior_focal_length"));
  EXPECT_THAT(Columns(db, "images"),
              ElementsAre("image_id",
                          "name",
                          "camera_id",
                          "prior_qw",
                          "prior_qx",
                          "prior_qy",
                          "prior_qz",
                          "prior_tx",
                          "prior_ty",
                          "prior_tz"));
  EXPECT_THAT(Columns(db, "keypoints"), ElementsAre("image_id", "rows", "cols", "data"));
  EXPECT_THAT(Columns(db, "descriptors"), ElementsAre("image_id", "rows", "cols", "data"));
  EXPECT_THAT(Columns(db, "matches"), ElementsAre("pair_id", "rows", "cols", "data"));
  EXPECT_THAT(
      Columns(db, "two_view_geometries"),
      ElementsAre("pair_id", "rows", "cols", "data", "config", "F", "E", "H", "qvec", "tvec"));
  auto foreign_keys = db.Prepare("PRAGMA foreign_key_check");
  EXPECT_FALSE(foreign_keys.Step());
}

TEST(ColmapDatabase, KeypointBytesAreOurPixelsPlusAHalf) {
  const TempDir dir;
  WriteColmapDatabase(dir / "a.db", ThreeFrames());
  auto db = Open(dir / "a.db");
  auto select = db.Prepare("SELECT rows, cols, data FROM keypoints ORDER BY image_id");
  ASSERT_TRUE(select.Step());
  EXPECT_EQ(select.Int(0), 2);
  EXPECT_EQ(select.Int(1), 2);
  EXPECT_THAT(As<float>(select.Blob(2)), ElementsAre(10.75F, 21.0F, 0.5F, 0.5F));
  ASSERT_TRUE(select.Step());
  EXPECT_EQ(select.Int(0), 1) << "the predicted position is left out";
  EXPECT_THAT(As<float>(select.Blob(2)), ElementsAre(1.5F, 2.5F));
  ASSERT_TRUE(select.Step());
  EXPECT_EQ(select.Int(0), 0);
  EXPECT_EQ(select.Int(1), 2) << "COLMAP 3.8 aborts on an empty frame of 0 columns";
  EXPECT_FALSE(select.IsNull(2));
}

TEST(ColmapDatabase, NamesATrackThatColmapCannotHold) {
  TrackFile far_off = ThreeFrames();
  far_off.tracks =
      TrackSet::Build({{.feature = FeatureId{0}, .frame = FrameIndex{1}, .xy = {1e200, 4.0}}});
  EXPECT_THAT([&] { BuildColmapDatabase(far_off); },
              ThrowsMessage<Error>(HasSubstr("track 0 is at 1.0e+200, 4.0e+00 in frame 1")));
}

TEST(ColmapDatabase, LeavesOutWhatIsMeasuredMuchWorseThanTheRest) {
  TrackFile file = ThreeFrames();
  std::vector<Observation> observations;
  for (std::uint32_t f = 0; f < 10; ++f) {
    const float sigma_px = f == 7 ? 0.9F : 0.5F;
    Observation o{.feature = FeatureId{f}, .frame = FrameIndex{0}};
    o.covariance = PixelCovariance{sigma_px * sigma_px, 0.0F, sigma_px * sigma_px};
    observations.push_back(o);
  }
  observations[8].covariance.reset();
  observations[9].state = ObservationState::kPredicted;
  file.tracks = TrackSet::Build(observations);
  const auto observed = [&](double max_relative_sigma) {
    ColmapDatabaseOptions options;
    options.max_relative_sigma = max_relative_sigma;
    return WithoutWeakObservations(file, options).tracks.CountObserved();
  };
  EXPECT_EQ(observed(1.5), 8u) << "all but 7 and 9";
  EXPECT_EQ(observed(2.0), 9u);
  EXPECT_EQ(observed(0.0), 9u) << "switched off";

  const TempDir dir;
  WriteColmapDatabase(dir / "a.db", file);
  EXPECT_EQ(ReadColmapDatabase(dir / "a.db").images.at(1).keypoints.size(), 8u);
}

TEST(ColmapDatabase, ABlurredFrameKeepsWhatTiesItToTheOthers) {
  TrackFile file = ThreeFrames();
  std::vector<Observation> observations;
  for (std::uint32_t frame = 0; frame < 3; ++frame) {
    const float sigma_px = frame == 1 ? 2.0F : 0.5F;
    for (std::uint32_t f = 0; f < 10; ++f) {
      const float own_px = f == 7 ? 2.0F * sigma_px : sigma_px;
      Observation o{.feature = FeatureId{f}, .frame = FrameIndex{frame}};
      o.covariance = PixelCovariance{own_px * own_px, 0.0F, own_px * own_px};
      observations.push_back(o);
    }
  }
  file.tracks = TrackSet::Build(observations);
  const TrackFile strong = WithoutWeakObservations(file, {});
  for (std::uint32_t frame = 0; frame < 3; ++frame) {
    EXPECT_EQ(ColmapKeypoints(strong.tracks, FrameIndex{frame}).size(), 9u) << frame;
  }
}

TEST(ColmapDatabase, CameraIsPinholeOpencvOrAGuess) {
  TrackFile file = ThreeFrames();
  EXPECT_EQ(BuildColmapDatabase(file).camera.model, ColmapCameraModel::kPinhole);
  EXPECT_THAT(BuildColmapDatabase(file).camera.params, ElementsAre(500, 500, 320, 240));
  EXPECT_TRUE(BuildColmapDatabase(file).camera.prior_focal_length);
  file.camera->k1 = -0.1;
  file.camera->p2 = 0.01;
  EXPECT_EQ(BuildColmapDatabase(file).camera.model, ColmapCameraModel::kOpencv);
  EXPECT_THAT(BuildColmapDatabase(file).camera.params,
              ElementsAre(500, 500, 320, 240, -0.1, 0, 0, 0.01));
  file.camera->k3 = 0.2;
  EXPECT_EQ(BuildColmapDatabase(file).camera.model, ColmapCameraModel::kFullOpencv);
  EXPECT_THAT(BuildColmapDatabase(file).camera.params,
              ElementsAre(500, 500, 320, 240, -0.1, 0, 0, 0.01, 0.2, 0, 0, 0));
  file.camera->model = CameraModel::kFisheye;
  EXPECT_EQ(BuildColmapDatabase(file).camera.model, ColmapCameraModel::kOpencvFisheye);
  EXPECT_THAT(BuildColmapDatabase(file).camera.params,
              ElementsAre(500, 500, 320, 240, -0.1, 0, 0.2, 0));
  EXPECT_TRUE(BuildColmapDatabase(file).camera.prior_focal_length);
  file.camera.reset();
  EXPECT_EQ(BuildColmapDatabase(file).camera.model, ColmapCameraModel::kSimpleRadial);
  EXPECT_THAT(BuildColmapDatabase(file).camera.params, ElementsAre(768, 320, 240, 0));
  EXPECT_FALSE(BuildColmapDatabase(file).camera.prior_focal_length);
}

TEST(ColmapDatabase, CamerasComeBackFromTheirColmapForm) {
  Camera camera = SyntheticTracksOptions::DefaultCamera();
  camera.fy = 510;
  camera.k1 = -0.1;
  camera.k2 = 0.02;
  camera.p1 = 0.003;
  camera.p2 = -0.004;
  const Camera back = FromColmapCamera(ToColmapCamera(camera));
  EXPECT_EQ(back.fy, 510);
  EXPECT_EQ(back.cx, camera.cx);
  EXPECT_EQ(back.k2, 0.02);
  EXPECT_EQ(back.p2, -0.004);
  ColmapCamera wrong = ToColmapCamera(camera);
  wrong.params.pop_back();
  EXPECT_THAT([&] { FromColmapCamera(wrong); },
              ThrowsMessage<Error>(HasSubstr("7 parameters instead of 8")));
  EXPECT_THAT([] { ColmapModelFromName("FISHEYE"); },
              ThrowsMessage<Error>(HasSubstr("FISHEYE is not supported")));
}

TEST(ColmapDatabase, CamerasOfAllModelsComeBackFromTheirColmapForm) {
  for (const Camera& camera :
       {test::FreiburgCamera(), test::RationalCamera(), test::FisheyeCamera()}) {
    const Camera back = FromColmapCamera(ToColmapCamera(camera));
    EXPECT_EQ(back.model, camera.model);
    for (const auto number : test::kCameraNumbers) {
      EXPECT_EQ(back.*number, camera.*number);
    }
  }
}

// COLMAP refines whatever the model has: two focal lengths and tangential distortion of a camera
// that nobody knows go astray in the dark.
TEST(ColmapDatabase, AGuessedCameraHasOneFocalLengthAndRadialDistortionAlone) {
  Camera camera = Camera::Guess(640, 480);
  EXPECT_EQ(ToColmapCamera(camera).model, ColmapCameraModel::kSimpleRadial);
  camera = WithIntrinsics(camera, {619.3, camera.cx, camera.cy, 0.03, -0.01});  // refined
  const ColmapCamera refined = ToColmapCamera(camera);
  EXPECT_EQ(refined.model, ColmapCameraModel::kRadial);
  const Camera back = FromColmapCamera(refined);
  EXPECT_NEAR(back.fx, camera.fx, 1e-9);
  EXPECT_EQ(back.k2, -0.01);
  camera.p1 = 0.001;
  EXPECT_EQ(ToColmapCamera(camera).model, ColmapCameraModel::kOpencv);
}

TEST(ColmapDatabase, ReadsFisheyesOfOneFocalLength) {
  EXPECT_EQ(ColmapModelFromName("SIMPLE_RADIAL_FISHEYE"), ColmapCameraModel::kSimpleRadialFisheye);
  ColmapCamera colmap{.model = ColmapCameraModel::kRadialFisheye,
                      .width_px = 640,
                      .height_px = 480,
                      .params = {300, 320, 240, 0.1, 0.2}};
  const Camera camera = FromColmapCamera(colmap);
  EXPECT_EQ(camera.model, CameraModel::kFisheye);
  EXPECT_EQ(camera.fx, 300);
  EXPECT_EQ(camera.fy, 300);
  EXPECT_EQ(camera.cx, 319.5);
  EXPECT_EQ(camera.cy, 239.5);
  EXPECT_EQ(camera.k1, 0.1);
  EXPECT_EQ(camera.k2, 0.2);
  colmap.model = static_cast<ColmapCameraModel>(7);
  EXPECT_THAT([&] { FromColmapCamera(colmap); },
              ThrowsMessage<Error>(HasSubstr("model 7 is not supported: use one of "
                                             "SIMPLE_PINHOLE, PINHOLE")));
}

TEST(ColmapDatabase, ARefinedCameraKeepsItsModelOrGetsOneThatHoldsIt) {
  ColmapCamera before{.model = ColmapCameraModel::kSimpleRadialFisheye,
                      .width_px = 640,
                      .height_px = 480,
                      .params = {300, 320, 240, 0.1}};
  Camera camera = FromColmapCamera(before);
  EXPECT_EQ(ToColmapCamera(camera, before).model, ColmapCameraModel::kSimpleRadialFisheye);
  EXPECT_EQ(ToColmapCamera(camera, before).params, before.params);
  camera.k2 = 0.01;
  const ColmapCamera after = ToColmapCamera(camera, before);
  EXPECT_EQ(after.model, ColmapCameraModel::kOpencvFisheye);
  EXPECT_EQ(after.params, (std::vector<double>{300, 300, 320, 240, 0.1, 0.01, 0, 0}));
  EXPECT_EQ(ToColmapCamera(camera, after).model, ColmapCameraModel::kOpencvFisheye);
}

TEST(ColmapDatabase, PairIdsComeBackUpToTheLargest) {
  const ColmapImageId largest = 2147483646;
  EXPECT_EQ(ColmapPairId(1, 2), 2147483649);
  EXPECT_EQ(ColmapPairId(2, 1), ColmapPairId(1, 2));
  for (const auto& [a, b] : {std::pair<ColmapImageId, ColmapImageId>{1, 2},
                             {1, largest},
                             {largest - 1, largest},
                             {77, 90210}}) {
    EXPECT_EQ(ColmapImagesOfPair(ColmapPairId(a, b)), std::pair(a, b));
  }
  EXPECT_EQ(FrameOfColmapImage(ColmapImageIdOf(FrameIndex{41})), FrameIndex{41});
  EXPECT_EQ(ColmapImageIdOf(FrameIndex{largest - 1}), largest);
  EXPECT_THROW(ColmapImageIdOf(FrameIndex{largest}), Error);
}

TEST(ColmapDatabase, SwappedPairSaysTheSame) {
  SyntheticTracksOptions options;
  options.noise_px = 0;
  options.frames = 12;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  const ColmapDatabase database = BuildColmapDatabase(scene.file);
  const ColmapPair& pair = database.pairs.at({1, 9});
  ASSERT_TRUE(pair.geometry && pair.geometry->cam2_from_cam1);
  const ColmapPair swapped = pair.Swapped();
  const auto& keypoints1 = database.images.at(9).keypoints;  // of the swapped pair
  const auto& keypoints2 = database.images.at(1).keypoints;
  for (std::size_t i = 0; i < swapped.geometry->inliers.size(); ++i) {
    const auto [i1, i2] = swapped.geometry->inliers[i];
    EXPECT_EQ(swapped.matches[i][0], pair.matches[i][1]);
    const Eigen::Vector3d x1 = keypoints1[i1].cast<double>().homogeneous();
    const Eigen::Vector3d x2 = keypoints2[i2].cast<double>().homogeneous();
    const Eigen::Vector3d line = *swapped.geometry->fundamental * x1;
    EXPECT_LT(std::abs(x2.dot(line)) / line.head<2>().norm(), 0.01);
  }
  const Rigid3 cam1_from_cam9 =
      scene.cam_from_world.at(FrameIndex{0}) * scene.cam_from_world.at(FrameIndex{8}).Inverse();
  const Rigid3& pose = *swapped.geometry->cam2_from_cam1;
  EXPECT_LT(AngleBetween(pose.rotation, cam1_from_cam9.rotation), 1e-5);
  EXPECT_LT((pose.translation - cam1_from_cam9.translation.normalized()).norm(), 1e-5);
  const Eigen::Matrix3d from_pose = EssentialFromPose(pose);  // up to sign
  EXPECT_NEAR(std::abs(swapped.geometry->essential->cwiseProduct(from_pose).sum()), 2.0, 1e-9);
  ColmapDatabase other = database;
  other.pairs.clear();
  other.AddPair(9, 1, swapped);
  EXPECT_EQ(other.pairs.at({1, 9}).matches, pair.matches);
}

TEST(ColmapDatabase, MatricesAreRowMajorAndActOnColmapPixels) {
  const TempDir dir;
  SyntheticTracksOptions options;
  options.noise_px = 0;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  WriteColmapDatabase(dir / "a.db", scene.file);
  auto db = Open(dir / "a.db");
  auto keypoints = db.Prepare("SELECT data FROM keypoints WHERE image_id = ?");
  const auto points_of = [&](std::int64_t image) {
    keypoints.Bind(1, image);
    EXPECT_TRUE(keypoints.Step());
    auto values = As<float>(keypoints.Blob(0));
    keypoints.Step();
    return values;
  };
  auto select = db.Prepare(
      "SELECT rows, cols, data, config, F, E, qvec, tvec FROM two_view_geometries "
      "WHERE pair_id = ?");
  select.Bind(1, ColmapPairId(1, 17));
  ASSERT_TRUE(select.Step());
  EXPECT_EQ(select.Int(1), 2);
  EXPECT_EQ(select.Int(3), 2);
  const auto inliers = As<std::uint32_t>(select.Blob(2));
  ASSERT_EQ(inliers.size(), static_cast<std::size_t>(2 * select.Int(0)));
  const auto f = As<double>(select.Blob(4));
  const auto e = As<double>(select.Blob(5));
  const auto q = As<double>(select.Blob(6));
  const auto t = As<double>(select.Blob(7));
  ASSERT_EQ(f.size(), 9u);
  ASSERT_EQ(e.size(), 9u);
  const auto x1 = points_of(1);
  const auto x2 = points_of(17);
  for (std::size_t i = 0; i < inliers.size(); i += 2) {
    const float* a = &x1[2 * inliers[i]];
    const float* b = &x2[2 * inliers[i + 1]];
    const double line[3] = {f[0] * a[0] + f[1] * a[1] + f[2],
                            f[3] * a[0] + f[4] * a[1] + f[5],
                            f[6] * a[0] + f[7] * a[1] + f[8]};
    EXPECT_LT(std::abs(line[0] * b[0] + line[1] * b[1] + line[2]) / std::hypot(line[0], line[1]),
              0.01);
    const double ray[2] = {(a[0] - 320) / 500, (a[1] - 240) / 500};
    const double ray2[2] = {(b[0] - 320) / 500, (b[1] - 240) / 500};
    EXPECT_NEAR(ray2[0] * (e[0] * ray[0] + e[1] * ray[1] + e[2]) +
                    ray2[1] * (e[3] * ray[0] + e[4] * ray[1] + e[5]) +
                    (e[6] * ray[0] + e[7] * ray[1] + e[8]),
                0.0,
                1e-4);
  }
  const Rigid3 truth =
      scene.cam_from_world.at(FrameIndex{16}) * scene.cam_from_world.at(FrameIndex{0}).Inverse();
  EXPECT_LT(AngleBetween(Eigen::Quaterniond(q[0], q[1], q[2], q[3]), truth.rotation), 1e-5);
  EXPECT_LT((Eigen::Vector3d(t[0], t[1], t[2]) - truth.translation.normalized()).norm(), 1e-4);
}

TEST(ColmapDatabase, EveryImageOfAZoomHasItsOwnCameraAndPairsTheirGeometry) {
  const TempDir dir;
  SyntheticTracksOptions options;
  options.noise_px = 0;
  const SyntheticTracks still = MakeSyntheticTracks(options);
  const FocalScales scales = test::ZoomOf(still.file.frames);
  const SyntheticTracks scene = test::Zoomed(still, scales);
  const ColmapDatabase database = BuildColmapDatabase(scene.file, {}, {}, scales);
  const ColmapDatabase same = BuildColmapDatabase(still.file);
  ASSERT_EQ(database.pairs.size(), same.pairs.size());
  for (const auto& [ids, pair] : database.pairs) {
    const auto& keypoints1 = database.images.at(ids.first).keypoints;
    const auto& keypoints2 = database.images.at(ids.second).keypoints;
    ASSERT_TRUE(pair.geometry && pair.geometry->fundamental);
    EXPECT_EQ(pair.geometry->inliers.size(), same.pairs.at(ids).geometry->inliers.size());
    for (const ColmapMatch& match : pair.geometry->inliers) {
      const Eigen::Vector3d a = keypoints1[match[0]].cast<double>().homogeneous();
      const Eigen::Vector3d b = keypoints2[match[1]].cast<double>().homogeneous();
      const Eigen::Vector3d line = *pair.geometry->fundamental * a;
      EXPECT_LT(std::abs(line.dot(b)) / line.head<2>().norm(), 0.01);
    }
  }

  WriteColmapDatabase(dir / "a.db", scene.file, {}, scales);
  auto db = Open(dir / "a.db");
  auto select = db.Prepare(
      "SELECT image_id, params FROM images JOIN cameras USING (camera_id) ORDER BY image_id");
  std::size_t images = 0;
  while (select.Step()) {
    const FrameIndex frame = FrameOfColmapImage(static_cast<ColmapImageId>(select.Int(0)));
    EXPECT_EQ(As<double>(select.Blob(1))[0], scene.file.camera->fx * scales.at(frame));
    ++images;
  }
  EXPECT_EQ(images, scene.file.frames.size());
}

TEST(ColmapDatabase, PairsLieOnAChainAndPowersOfTwo) {
  SyntheticTracksOptions options;
  options.frames = 20;
  const ColmapDatabase database = BuildColmapDatabase(MakeSyntheticTracks(options).file);
  std::map<std::uint32_t, int> pairs_of_stride;
  for (const auto& [ids, pair] : database.pairs) {
    const std::uint32_t stride = ids.second - ids.first;
    ++pairs_of_stride[stride];
    EXPECT_EQ((ids.first - 1) % std::max(1u, stride / 2), 0u);
  }
  EXPECT_THAT(pairs_of_stride,
              ElementsAre(std::pair(1u, 19),
                          std::pair(2u, 18),
                          std::pair(4u, 8),
                          std::pair(8u, 3),
                          std::pair(16u, 1)));
  ColmapDatabaseOptions chain;
  chain.max_stride = 1;
  EXPECT_EQ(BuildColmapDatabase(MakeSyntheticTracks(options).file, chain).pairs.size(), 19u);
}

TEST(ColmapDatabase, AContradictedMatchIsAMatchButNoInlier) {
  SyntheticTracksOptions options;
  options.outlier_fraction = 0.05;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  const ColmapDatabase database = BuildColmapDatabase(scene.file);
  std::size_t outliers = 0, outliers_kept = 0, lost = 0, matches = 0;
  for (const auto& [ids, pair] : database.pairs) {
    const FrameIndex frame1 = FrameOfColmapImage(ids.first);
    const FrameIndex frame2 = FrameOfColmapImage(ids.second);
    ASSERT_TRUE(pair.geometry);
    const std::set<ColmapMatch> inliers(pair.geometry->inliers.begin(),
                                        pair.geometry->inliers.end());
    const auto keypoints1 = ColmapKeypoints(scene.file.tracks, frame1);
    const auto keypoints2 = ColmapKeypoints(scene.file.tracks, frame2);
    for (const ColmapMatch& match : pair.matches) {
      const FeatureId feature = keypoints1[match[0]]->feature;
      ASSERT_EQ(keypoints2[match[1]]->feature, feature);
      const bool outlier =
          scene.outliers.contains({feature, frame1}) || scene.outliers.contains({feature, frame2});
      ++matches;
      outliers += outlier;
      outliers_kept += outlier && inliers.contains(match);
      lost += !outlier && !inliers.contains(match);
    }
  }
  EXPECT_GT(outliers, matches / 20);
  EXPECT_LT(outliers_kept, outliers / 25) << outliers << " outliers";
  EXPECT_LT(lost, matches / 500) << matches << " matches";
}

TEST(ColmapDatabase, TurningOnTheSpotIsPanoramicAndHasNoPose) {
  SyntheticTracksOptions options;
  options.path = CameraPath::kRotation;
  const ColmapDatabase database = BuildColmapDatabase(MakeSyntheticTracks(options).file);
  const auto& geometry = *database.pairs.at({1, 9}).geometry;
  EXPECT_EQ(geometry.config, ColmapPairConfig::kPanoramic);
  EXPECT_TRUE(geometry.homography);
  EXPECT_FALSE(geometry.essential || geometry.fundamental || geometry.cam2_from_cam1);
}

TEST(ColmapDatabase, ReadsWhatItWrote) {
  const TempDir dir;
  SyntheticTracksOptions options;
  options.frames = 9;
  options.first_frame = 30;
  options.frame_stride = 3;
  options.outlier_fraction = 0.02;
  const ColmapDatabase built = BuildColmapDatabase(MakeSyntheticTracks(options).file);
  WriteColmapDatabase(dir / "a.db", built);
  const ColmapDatabase read = ReadColmapDatabase(dir / "a.db");
  EXPECT_EQ(read.camera.params, built.camera.params);
  ASSERT_EQ(read.images.size(), 9u);
  for (const auto& [id, image] : built.images) {
    EXPECT_EQ(read.images.at(id).name, image.name);
    EXPECT_EQ(read.images.at(id).keypoints, image.keypoints);
  }
  ASSERT_EQ(read.pairs.size(), built.pairs.size());
  for (const auto& [ids, pair] : built.pairs) {
    const ColmapPair& other = read.pairs.at(ids);
    EXPECT_EQ(other.matches, pair.matches);
    ASSERT_EQ(other.geometry.has_value(), pair.geometry.has_value());
    EXPECT_EQ(other.geometry->inliers, pair.geometry->inliers);
    EXPECT_EQ(other.geometry->fundamental, pair.geometry->fundamental);
    EXPECT_EQ(other.geometry->essential, pair.geometry->essential);
    EXPECT_EQ(other.geometry->homography, pair.geometry->homography);
    EXPECT_EQ(other.geometry->cam2_from_cam1->translation,
              pair.geometry->cam2_from_cam1->translation);
  }
}

TEST(ColmapDatabase, SameTracksGiveTheSameBytes) {
  const TempDir dir;
  SyntheticTracksOptions options;
  options.frames = 6;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  WriteColmapDatabase(dir / "a.db", scene.file);
  WriteColmapDatabase(dir / "b.db", scene.file);
  EXPECT_EQ(ReadBytes(dir / "a.db"), ReadBytes(dir / "b.db"));
}

TEST(ColmapDatabase, ReplacesAnOldFileWholeWithItsLogs) {
  const TempDir dir;
  WriteBytes(dir / "a.db", "old");
  WriteBytes(dir / "a.db-wal", "stale");
  WriteBytes(dir / "a.db-shm", "stale");
  TrackFile bad = ThreeFrames();
  bad.frames[1].name = bad.frames[0].name;
  EXPECT_THAT([&] { WriteColmapDatabase(dir / "a.db", bad); },
              ThrowsMessage<Error>(HasSubstr("two frames are named a/0.png")));
  EXPECT_EQ(ReadBytes(dir / "a.db"), "old");
  WriteColmapDatabase(dir / "a.db", ThreeFrames());
  EXPECT_EQ(ReadColmapDatabase(dir / "a.db").images.size(), 3u);
  EXPECT_FALSE(std::filesystem::exists(dir / "a.db-wal"));
  EXPECT_FALSE(std::filesystem::exists(dir / "a.db-shm"));
  EXPECT_FALSE(std::filesystem::exists(dir / "a.db.partial"));
}

TEST(ColmapDatabase, OnAFullDiskTheOldFileStays) {
  const TempDir dir;
  WriteColmapDatabase(dir / "a.db", ThreeFrames());
  const std::string old = ReadBytes(dir / "a.db");
  const SyntheticTracks scene = MakeSyntheticTracks();
  // A bound on the size of files stands in for the disk.
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const rlimit small{100'000, before.rlim_max};
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  setrlimit(RLIMIT_FSIZE, &small);
  EXPECT_THAT([&] { WriteColmapDatabase(dir / "a.db", scene.file); },
              ThrowsMessage<Error>(HasSubstr("a.db")));
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, handler);
  EXPECT_EQ(ReadBytes(dir / "a.db"), old);
  EXPECT_FALSE(std::filesystem::exists(dir / "a.db.partial"));
}

TEST(ColmapDatabase, RefusesTracksInAFrameThatIsNotListed) {
  TrackFile file = ThreeFrames();
  file.frames.erase(file.frames.begin());
  EXPECT_THAT([&] { BuildColmapDatabase(file); }, ThrowsMessage<Error>(HasSubstr("frame 0")));
}

TEST(ColmapDatabase, RefusesMatchesThatColmapWouldDrop) {
  ColmapDatabase database = BuildColmapDatabase(ThreeFrames());
  EXPECT_THAT(
      [&] {
        database.AddPair(1, 2, {{{0, 7}}, {}});
      },
      ThrowsMessage<Error>(HasSubstr("past their")));
  EXPECT_THAT(
      [&] {
        database.AddPair(1, 2, {{{0, 0}, {1, 0}}, {}});
      },
      ThrowsMessage<Error>(HasSubstr("match a keypoint twice")));
  EXPECT_THAT([&] { database.AddPair(2, 2, {}); }, ThrowsMessage<Error>(HasSubstr("no pair")));
}

// ---- Schemas of other COLMAPs, as these create them ----

constexpr const char* kCommonTables = R"(
CREATE TABLE cameras(camera_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, model INTEGER NOT NULL,
  width INTEGER NOT NULL, height INTEGER NOT NULL, params BLOB, prior_focal_length INTEGER NOT NULL);
CREATE TABLE images(image_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, name TEXT NOT NULL UNIQUE,
  camera_id INTEGER NOT NULL,
  CONSTRAINT image_id_check CHECK(image_id >= 0 and image_id < 2147483647),
  FOREIGN KEY(camera_id) REFERENCES cameras(camera_id));
CREATE UNIQUE INDEX index_name ON images(name);
CREATE TABLE keypoints(image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,
  cols INTEGER NOT NULL, data BLOB,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE matches(pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,
  cols INTEGER NOT NULL, data BLOB);
)";
constexpr const char* kDescriptors = R"(
CREATE TABLE descriptors(image_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,
  cols INTEGER NOT NULL, data BLOB,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
)";
constexpr const char* kDescriptorsWithType = R"(
CREATE TABLE descriptors(image_id INTEGER PRIMARY KEY NOT NULL, type INTEGER NOT NULL,
  rows INTEGER NOT NULL, cols INTEGER NOT NULL, data BLOB,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
)";
constexpr const char* kPosePriorsOfImages = R"(
CREATE TABLE pose_priors(image_id INTEGER PRIMARY KEY NOT NULL, position BLOB,
  coordinate_system INTEGER NOT NULL, position_covariance BLOB,
  FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
INSERT INTO pose_priors VALUES(1, x'00', 1, NULL);
)";
constexpr const char* kPosePriorsOfSensors = R"(
CREATE TABLE pose_priors(pose_prior_id INTEGER PRIMARY KEY NOT NULL, corr_data_id INTEGER NOT NULL,
  corr_sensor_id INTEGER NOT NULL, corr_sensor_type INTEGER NOT NULL, position BLOB,
  position_covariance BLOB, gravity BLOB, coordinate_system INTEGER NOT NULL);
CREATE UNIQUE INDEX pose_prior_data_assignment
  ON pose_priors(corr_data_id, corr_sensor_id, corr_sensor_type);
INSERT INTO pose_priors VALUES(1, 1, 1, 0, x'00', NULL, NULL, 1);
)";
constexpr const char* kRigsAndFrames = R"(
CREATE TABLE rigs(rig_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, ref_sensor_id INTEGER NOT NULL,
  ref_sensor_type INTEGER NOT NULL);
CREATE UNIQUE INDEX rig_ref_sensor_assignment ON rigs(ref_sensor_id, ref_sensor_type);
CREATE TABLE rig_sensors(rig_id INTEGER NOT NULL, sensor_id INTEGER NOT NULL,
  sensor_type INTEGER NOT NULL, sensor_from_rig BLOB,
  FOREIGN KEY(rig_id) REFERENCES rigs(rig_id) ON DELETE CASCADE);
CREATE UNIQUE INDEX rig_sensor_assignment ON rig_sensors(sensor_id, sensor_type);
CREATE TABLE frames(frame_id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, rig_id INTEGER NOT NULL,
  FOREIGN KEY(rig_id) REFERENCES rigs(rig_id) ON DELETE CASCADE);
CREATE TABLE frame_data(frame_id INTEGER NOT NULL, data_id INTEGER NOT NULL,
  sensor_id INTEGER NOT NULL, sensor_type INTEGER NOT NULL,
  FOREIGN KEY(frame_id) REFERENCES frames(frame_id) ON DELETE CASCADE);
CREATE UNIQUE INDEX frame_sensor_assignment ON frame_data(data_id, sensor_type);
INSERT INTO rigs VALUES(1, 1, 0);
)";
constexpr const char* kGeometries = R"(
CREATE TABLE two_view_geometries(pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,
  cols INTEGER NOT NULL, data BLOB, config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB, qvec BLOB,
  tvec BLOB);
)";
constexpr const char* kGeometriesWithCameras = R"(
CREATE TABLE two_view_geometries(pair_id INTEGER PRIMARY KEY NOT NULL, rows INTEGER NOT NULL,
  cols INTEGER NOT NULL, data BLOB, config INTEGER NOT NULL, F BLOB, E BLOB, H BLOB, qvec BLOB,
  tvec BLOB, camera1 BLOB, camera2 BLOB);
)";

struct Schema {
  const char* name;
  int user_version;
  std::vector<const char*> tables;
  bool has_frames;
};
const std::vector<Schema>& NewerSchemas() {
  static const std::vector<Schema> schemas{
      {"3.10", 3100, {kCommonTables, kDescriptors, kGeometries, kPosePriorsOfImages}, false},
      {"3.12",
       3120,
       {kCommonTables, kDescriptors, kGeometries, kPosePriorsOfImages, kRigsAndFrames},
       true},
      {"4.1.1",
       4010100,
       {kCommonTables, kDescriptorsWithType, kGeometries, kPosePriorsOfSensors, kRigsAndFrames},
       true},
      {"4.2",
       4020000,
       {kCommonTables,
        kDescriptorsWithType,
        kGeometriesWithCameras,
        kPosePriorsOfSensors,
        kRigsAndFrames},
       true}};
  return schemas;
}

// The rows of a database of ours in another COLMAP's tables.
void CopyInto(const std::filesystem::path& path,
              const Schema& schema,
              const std::filesystem::path& ours) {
  auto db = SqliteDatabase::Open(path, SqliteDatabase::Mode::kCreate);
  for (const char* tables : schema.tables) db.Execute(tables);
  db.Execute("ATTACH '" + ours.string() + "' AS ours;" +
             "INSERT INTO cameras SELECT * FROM ours.cameras;"
             "INSERT INTO images SELECT image_id, name, camera_id FROM ours.images;"
             "INSERT INTO keypoints SELECT * FROM ours.keypoints;"
             "INSERT INTO matches SELECT * FROM ours.matches;"
             "INSERT INTO two_view_geometries(pair_id, rows, cols, data, config, F, E, H, qvec, "
             "tvec) SELECT * FROM ours.two_view_geometries;");
  if (schema.has_frames) {
    db.Execute(
        "INSERT INTO frames SELECT image_id, 1 FROM ours.images;"
        "INSERT INTO frame_data SELECT image_id, image_id, 1, 0 FROM ours.images;");
  }
  db.Execute("DETACH ours; PRAGMA user_version = " + std::to_string(schema.user_version));
}

void ExpectSameDatabase(const ColmapDatabase& read, const ColmapDatabase& built) {
  EXPECT_EQ(read.camera.model, built.camera.model);
  EXPECT_EQ(read.camera.params, built.camera.params);
  EXPECT_EQ(read.camera.prior_focal_length, built.camera.prior_focal_length);
  ASSERT_EQ(read.images.size(), built.images.size());
  for (const auto& [id, image] : built.images) {
    EXPECT_EQ(read.images.at(id).name, image.name);
    EXPECT_EQ(read.images.at(id).keypoints, image.keypoints);
  }
  ASSERT_EQ(read.pairs.size(), built.pairs.size());
  for (const auto& [ids, pair] : built.pairs) {
    const ColmapPair& other = read.pairs.at(ids);
    EXPECT_EQ(other.matches, pair.matches);
    ASSERT_EQ(other.geometry.has_value(), pair.geometry.has_value());
    if (!pair.geometry) continue;
    EXPECT_EQ(other.geometry->config, pair.geometry->config);
    EXPECT_EQ(other.geometry->inliers, pair.geometry->inliers);
    EXPECT_EQ(other.geometry->fundamental, pair.geometry->fundamental);
    EXPECT_EQ(other.geometry->essential, pair.geometry->essential);
    EXPECT_EQ(other.geometry->homography, pair.geometry->homography);
    ASSERT_EQ(other.geometry->cam2_from_cam1.has_value(),
              pair.geometry->cam2_from_cam1.has_value());
    if (!pair.geometry->cam2_from_cam1) continue;
    EXPECT_EQ(other.geometry->cam2_from_cam1->translation,
              pair.geometry->cam2_from_cam1->translation);
    EXPECT_EQ(other.geometry->cam2_from_cam1->rotation.coeffs(),
              pair.geometry->cam2_from_cam1->rotation.coeffs());
  }
}

TEST(ColmapDatabase, ReadsTheSchemasOfNewerColmaps) {
  const TempDir dir;
  SyntheticTracksOptions options;
  options.frames = 6;
  const ColmapDatabase built = BuildColmapDatabase(MakeSyntheticTracks(options).file);
  WriteColmapDatabase(dir / "ours.db", built);
  for (const Schema& schema : NewerSchemas()) {
    SCOPED_TRACE(schema.name);
    const auto path = dir / (std::string(schema.name) + ".db");
    CopyInto(path, schema, dir / "ours.db");
    ExpectSameDatabase(ReadColmapDatabase(path), built);
  }
}

TEST(ColmapDatabase, ReadsAFileThatANewerColmapMigrated) {
  const TempDir dir;
  const ColmapDatabase built = BuildColmapDatabase(ThreeFrames());
  WriteColmapDatabase(dir / "a.db", built);
  auto db = Open(dir / "a.db");
  // What 4.x adds when it opens a 3.8 file.
  db.Execute(kRigsAndFrames);
  db.Execute(kPosePriorsOfSensors);
  db.Execute(
      "ALTER TABLE descriptors ADD COLUMN type INTEGER DEFAULT 0;"
      "ALTER TABLE two_view_geometries ADD COLUMN camera1 BLOB;"
      "ALTER TABLE two_view_geometries ADD COLUMN camera2 BLOB;"
      "PRAGMA user_version = 4020000;");
  ExpectSameDatabase(ReadColmapDatabase(dir / "a.db"), built);
}

TEST(ColmapDatabase, WhatColmap3WroteAsUnsetIsNone) {
  const TempDir dir;
  SyntheticTracksOptions options;
  options.frames = 3;
  WriteColmapDatabase(dir / "a.db", MakeSyntheticTracks(options).file);
  const auto geometry = [&] {
    return *ReadColmapDatabase(dir / "a.db").pairs.begin()->second.geometry;
  };
  ASSERT_TRUE(geometry().cam2_from_cam1 && geometry().fundamental && geometry().essential);
  Open(dir / "a.db")
      .Execute(
          "UPDATE two_view_geometries SET F = zeroblob(72), E = zeroblob(72), "
          "qvec = zeroblob(32), tvec = zeroblob(24)");
  EXPECT_FALSE(geometry().fundamental || geometry().essential || geometry().cam2_from_cam1);
  // The identity: w = 1, little-endian.
  Open(dir / "a.db")
      .Execute(
          "UPDATE two_view_geometries SET qvec = CAST(x'000000000000F03F' || zeroblob(24) AS "
          "BLOB)");
  EXPECT_FALSE(geometry().cam2_from_cam1);
}

TEST(ColmapDatabase, NamesTheColumnThatASchemaLacks) {
  const TempDir dir;
  WriteColmapDatabase(dir / "a.db", ThreeFrames());
  Open(dir / "a.db")
      .Execute(
          "ALTER TABLE two_view_geometries RENAME COLUMN qvec TO rotation; PRAGMA user_version = "
          "9000000");
  EXPECT_THAT([&] { ReadColmapDatabase(dir / "a.db"); },
              ThrowsMessage<Error>(testing::AllOf(
                  HasSubstr("a.db"), HasSubstr("two_view_geometries.qvec"), HasSubstr("9000000"))));
}

TEST(ColmapDatabase, RefusesKeypointsOfOneColumnAndSeveralCameras) {
  const TempDir dir;
  WriteColmapDatabase(dir / "a.db", ThreeFrames());
  Open(dir / "a.db").Execute("UPDATE keypoints SET rows = rows * 2, cols = 1");
  EXPECT_THAT([&] { ReadColmapDatabase(dir / "a.db"); },
              ThrowsMessage<Error>(HasSubstr("have 1 columns")));
  WriteColmapDatabase(dir / "b.db", ThreeFrames());
  Open(dir / "b.db")
      .Execute(
          "INSERT INTO cameras SELECT 2, model, width + 1, height, params, prior_focal_length FROM "
          "cameras; UPDATE images SET camera_id = 2 WHERE image_id = 3");
  EXPECT_THAT([&] { ReadColmapDatabase(dir / "b.db"); },
              ThrowsMessage<Error>(HasSubstr("several cameras")));
}

TEST(ColmapDatabase, CamerasThatAreAlikeAreOne) {
  const TempDir dir;
  WriteColmapDatabase(dir / "a.db", ThreeFrames());
  Open(dir / "a.db")
      .Execute(
          "INSERT INTO cameras SELECT 2, model, width, height, params, prior_focal_length FROM "
          "cameras; UPDATE images SET camera_id = 2 WHERE image_id = 3");
  EXPECT_EQ(ReadColmapDatabase(dir / "a.db").camera.width_px, 640);
}

TEST(ColmapDatabase, CamerasOfWhichOneIsNotCalibratedAreAGuess) {
  const TempDir dir;
  WriteColmapDatabase(dir / "a.db", ThreeFrames());
  ASSERT_TRUE(ReadColmapDatabase(dir / "a.db").camera.prior_focal_length);
  Open(dir / "a.db")
      .Execute(
          "INSERT INTO cameras SELECT 2, model, width, height, params, 0 FROM cameras; UPDATE "
          "images SET camera_id = 2 WHERE image_id = 3");
  EXPECT_FALSE(ReadColmapDatabase(dir / "a.db").camera.prior_focal_length);
}

TEST(ColmapDatabase, RefusesACameraAndAPairThatCannotBe) {
  const TempDir dir;
  constexpr const char* kNoNumber =
      "UPDATE cameras SET params = CAST(x'000000000000F87F' || zeroblob(24) AS BLOB)";
  constexpr const char* kWideId =
      "PRAGMA ignore_check_constraints = 1; UPDATE images SET image_id = 4294967298 WHERE image_id "
      "= 2";
  for (const char* wrong : {"UPDATE cameras SET width = 0",
                            "UPDATE cameras SET height = 1 << 40",
                            "UPDATE cameras SET model = 77",
                            "UPDATE cameras SET params = zeroblob(8)",
                            kNoNumber,
                            "DELETE FROM images; DELETE FROM cameras",
                            "INSERT INTO matches VALUES(2147483647 * 2 + 2, 0, 2, NULL)",
                            "INSERT INTO matches VALUES(2147483647 * 2 + 9, 0, 2, NULL)",
                            "INSERT INTO matches VALUES(-5, 0, 2, NULL)",
                            "INSERT INTO matches VALUES(9223372034707292160, 0, 2, NULL)",
                            kWideId,
                            "UPDATE images SET name = '../x.png' WHERE image_id = 1",
                            "UPDATE images SET name = '/x.png' WHERE image_id = 1",
                            "UPDATE images SET name = 'a' || char(10) || 'b' WHERE image_id = 1"}) {
    WriteColmapDatabase(dir / "a.db", ThreeFrames());
    Open(dir / "a.db").Execute(wrong);
    EXPECT_THROW(ReadColmapDatabase(dir / "a.db"), Error) << wrong;
  }
}

TEST(ColmapDatabase, WithoutImagesSaysSoAndNotThatItHasNoCamera) {
  const TempDir dir;
  for (const char* emptied : {"DELETE FROM images", "DELETE FROM images; DELETE FROM cameras"}) {
    WriteColmapDatabase(dir / "a.db", ThreeFrames());
    Open(dir / "a.db").Execute(emptied);
    EXPECT_THAT([&] { ReadColmapDatabase(dir / "a.db"); },
                ThrowsMessage<Error>(testing::AllOf(HasSubstr("a.db has no images"),
                                                    HasSubstr("colmap feature_extractor"))))
        << emptied;
  }
  WriteColmapDatabase(dir / "a.db", ThreeFrames());
  Open(dir / "a.db").Execute("DELETE FROM cameras");
  EXPECT_THAT([&] { ReadColmapDatabase(dir / "a.db"); },
              ThrowsMessage<Error>(HasSubstr("has no camera of its images")));
}

TEST(ColmapDatabase, NamesADamagedOrForeignFile) {
  const TempDir dir;
  {
    auto db = SqliteDatabase::Open(dir / "other.db", SqliteDatabase::Mode::kCreate);
    db.Execute("CREATE TABLE t(x)");
  }
  EXPECT_THAT([&] { ReadColmapDatabase(dir / "other.db"); },
              ThrowsMessage<Error>(HasSubstr("is not a COLMAP database")));
  WriteColmapDatabase(dir / "a.db", ThreeFrames());
  Open(dir / "a.db").Execute("UPDATE keypoints SET rows = 5 WHERE image_id = 1");
  EXPECT_THAT([&] { ReadColmapDatabase(dir / "a.db"); },
              ThrowsMessage<Error>(
                  HasSubstr("table keypoints has 16 bytes instead of 10 values of 4 bytes")));
}

// Numbers whose product or size in bytes fits no integer.
TEST(ColmapDatabase, DoesNotBelieveWhatAFileSaysOfItsSizes) {
  const TempDir dir;
  for (const char* lie : {"UPDATE keypoints SET rows = 1 << 60",
                          "UPDATE keypoints SET rows = 1 << 62, cols = 4",
                          "UPDATE keypoints SET rows = -1",
                          "UPDATE keypoints SET cols = 1 << 62",
                          "INSERT OR REPLACE INTO matches VALUES(2147483649, 1 << 61, 2, NULL)",
                          "INSERT OR REPLACE INTO two_view_geometries "
                          "VALUES(2147483649, 1 << 60, 2, NULL, 2, NULL, NULL, NULL, NULL, NULL)",
                          "INSERT OR REPLACE INTO two_view_geometries "
                          "VALUES(2147483649, 0, 2, NULL, 2, zeroblob(1), NULL, NULL, NULL, NULL)",
                          "UPDATE cameras SET width = 1 << 40",
                          "UPDATE cameras SET params = zeroblob(32)"}) {
    WriteColmapDatabase(dir / "a.db", ThreeFrames());
    Open(dir / "a.db").Execute(lie);
    EXPECT_THROW(FromColmapCamera(ReadColmapDatabase(dir / "a.db").camera), Error) << lie;
  }
}

}  // namespace
}  // namespace cohort
