// Runs the installed colmap.
#include "backend/colmap/colmap_mapper.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sys/wait.h>
#include <unistd.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <fstream>

#include "backend/colmap/colmap_tracks.h"
#include "backend/colmap/initial_pair.h"
#include "backend/colmap/keypoint_covariances.h"
#include "backend/colmap/model_io.h"
#include "backend/colmap/program.h"
#include "backend/mapper/mapper.h"
#include "frontend/core/random_stream.h"
#include "frontend/core/statistics.h"
#include "frontend/storage/output.h"
#include "tests/support/cameras.h"
#include "tests/support/numpy.h"
#include "tests/support/source_dir.h"
#include "tests/support/synthetic_tracks.h"
#include "tests/support/temp_dir.h"
#include "tests/support/zoom.h"

namespace cohort {
namespace {

using test::AbsoluteTrajectoryError;
using test::CameraPath;
using test::MakeSyntheticTracks;
using test::SyntheticTracks;
using test::SyntheticTracksOptions;
using test::TempDir;
using testing::HasSubstr;
using testing::Not;
using testing::ThrowsMessage;

constexpr int kSomeOutliersPercent = 3;

SyntheticTracks ClipWithOutliers(CameraPath path) {
  SyntheticTracksOptions options;
  options.path = path;
  options.frames = 30;
  options.points = 350;
  options.max_track_length = 22;
  options.noise_px = 0.4;
  options.outlier_fraction = kSomeOutliersPercent / 100.0;
  options.missing_fraction = 0.1;
  options.first_frame = 12;
  options.frame_stride = 2;
  return MakeSyntheticTracks(options);
}

class MapperOnPath : public testing::TestWithParam<CameraPath> {};

TEST_P(MapperOnPath, RegistersEveryFrameNearTheTruth) {
  const TempDir dir;
  const SyntheticTracks scene = ClipWithOutliers(GetParam());
  const ColmapResult result = ReconstructWithColmap(scene.file, {}, dir / "work");
  EXPECT_EQ(result.summary.registered, 30u) << result.summary.Brief();
  EXPECT_FALSE(result.summary.Failed());
  EXPECT_LT(AbsoluteTrajectoryError(result.reconstruction.cam_from_world, scene.cam_from_world),
            0.025);  // of a path 2.5 to 4 long
  const std::size_t good = scene.file.tracks.CountObserved() - scene.outliers.size();
  EXPECT_GT(result.summary.observations, good * 85 / 100) << result.summary.Brief();
  EXPECT_LT(result.summary.observations, good * 101 / 100) << result.summary.Brief();
  EXPECT_GT(result.summary.mean_reprojection_px, 0.3);
  EXPECT_LT(result.summary.mean_reprojection_px, 0.7);
  // Views lie where the tracks are, of the feature they name.
  for (const auto& [feature, point] : result.reconstruction.points) {
    for (const PointView& view : point.views) {
      const Observation* o = scene.file.tracks.Find(feature, view.frame);
      ASSERT_NE(o, nullptr);
      ASSERT_EQ(o->xy, view.xy);
    }
  }
  EXPECT_THAT(result.summary.termination, HasSubstr("initial pair: frames"));
  const std::string log = ReadBytes(result.log);
  EXPECT_THAT(log, HasSubstr("mapper --database_path"));
  EXPECT_THAT(log, Not(HasSubstr("WARNING")));
}

INSTANTIATE_TEST_SUITE_P(Paths,
                         MapperOnPath,
                         testing::Values(CameraPath::kArc,
                                         CameraPath::kLateral,
                                         CameraPath::kForward));

TEST(ColmapMapper, RepeatsExactly) {
  const TempDir dir;
  SyntheticTracksOptions options;
  options.frames = 10;
  options.points = 80;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  const auto points_text = [&](const char* name) {
    const ColmapResult result = ReconstructWithColmap(scene.file, {}, dir / name);
    WriteReconstruction(dir / (std::string(name) + "_model"), result.reconstruction);
    return ReadBytes(dir / (std::string(name) + "_model") / "points3D.txt");
  };
  const std::string first = points_text("a");
  EXPECT_GT(first.size(), 1000u);
  EXPECT_EQ(first, points_text("b"));
  EXPECT_EQ(first, points_text("a")) << "into the same folder again";
}

TEST(ColmapMapper, FindsTheFocalLengthOfAnUnknownCamera) {
  const TempDir dir;
  SyntheticTracksOptions options;
  options.frames = 20;
  SyntheticTracks scene = MakeSyntheticTracks(options);
  scene.file.camera.reset();
  const ColmapResult result = ReconstructWithColmap(scene.file, {}, dir / "work");
  EXPECT_EQ(result.summary.registered, 20u) << result.summary.Brief();
  EXPECT_NEAR(result.reconstruction.camera.fx, 500.0, 25.0);
  EXPECT_FALSE(result.reconstruction.camera.known);
}

TEST(ColmapMapper, KeepsAKnownCameraWithDistortion) {
  const TempDir dir;
  SyntheticTracksOptions options;
  options.frames = 15;
  options.camera.k1 = -0.2;
  options.camera.p1 = 0.003;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  const ColmapResult result = ReconstructWithColmap(scene.file, {}, dir / "work");
  EXPECT_EQ(result.summary.registered, 15u) << result.summary.Brief();
  EXPECT_EQ(result.reconstruction.camera.k1, -0.2);
  EXPECT_EQ(result.reconstruction.camera.cx, 319.5);
  EXPECT_LT(AbsoluteTrajectoryError(result.reconstruction.cam_from_world, scene.cam_from_world),
            0.02);
}

TEST(ColmapMapper, KeepsAKnownFisheye) {
  const TempDir dir;
  SyntheticTracksOptions options;
  options.path = CameraPath::kLateral;
  options.frames = 15;
  options.camera = test::FisheyeCamera();
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  const ColmapResult result = ReconstructWithColmap(scene.file, {}, dir / "work");
  EXPECT_EQ(result.summary.registered, 15u) << result.summary.Brief();
  EXPECT_EQ(result.reconstruction.camera.model, CameraModel::kFisheye);
  EXPECT_EQ(result.reconstruction.camera.k4, options.camera.k4);
  EXPECT_LT(AbsoluteTrajectoryError(result.reconstruction.cam_from_world, scene.cam_from_world),
            0.02);
}

// The focal length doubles over the clip, and is held.
TEST(ColmapMapper, ReconstructsAZoomThatIsGiven) {
  const TempDir dir;
  const SyntheticTracks still = ClipWithOutliers(CameraPath::kArc);
  ColmapOptions options;
  options.focal_scale = test::ZoomOf(still.file.frames);
  const SyntheticTracks scene = test::Zoomed(still, options.focal_scale);
  const ColmapResult result = ReconstructWithColmap(scene.file, options, dir / "work");
  const Reconstruction& model = result.reconstruction;
  EXPECT_EQ(result.summary.registered, 30u) << result.summary.Brief();
  EXPECT_LT(result.summary.mean_reprojection_px, 1.0);
  EXPECT_LT(AbsoluteTrajectoryError(model.cam_from_world, scene.cam_from_world), 0.02);
  for (const auto& [frame, pose] : model.cam_from_world) {
    EXPECT_NEAR(CameraOf(model, frame).fx,
                CameraOf(*scene.file.camera, options.focal_scale, frame).fx,
                1e-6);
  }
}

TEST(ColmapMapper, ManagesWithFewTracks) {
  const TempDir dir;
  SyntheticTracksOptions options;
  options.points = 60;
  options.max_track_length = 18;
  const SyntheticTracks scene = MakeSyntheticTracks(options);  // about 24 a frame
  const ColmapResult result = ReconstructWithColmap(scene.file, {}, dir / "work");
  EXPECT_GE(result.summary.registered, 23u) << result.summary.Brief();
}

TEST(ColmapMapper, ReconstructsTwoFrames) {
  const TempDir dir;
  SyntheticTracksOptions options;
  options.frames = 2;
  const SyntheticTracks scene = MakeSyntheticTracks(options);
  const ColmapResult result = ReconstructWithColmap(scene.file, {}, dir / "work");
  EXPECT_EQ(result.summary.registered, 2u) << result.summary.Brief();
  EXPECT_GT(result.summary.points, 200u);
}

TEST(ColmapMapper, SaysWhyAClipDoesNotReconstruct) {
  const TempDir dir;
  const auto run = [&](const SyntheticTracksOptions& options) {
    const ColmapResult result =
        ReconstructWithColmap(MakeSyntheticTracks(options).file, {}, dir / "work");
    EXPECT_TRUE(result.summary.Failed()) << result.summary.Brief();
    EXPECT_EQ(result.summary.termination.find('\n'), std::string::npos);
    return result.summary.termination;
  };
  SyntheticTracksOptions options;
  options.path = CameraPath::kRotation;
  EXPECT_THAT(run(options), HasSubstr("pure rotation"));
  options.path = CameraPath::kStatic;
  EXPECT_THAT(run(options), HasSubstr("static camera"));
  options.path = CameraPath::kArc;
  options.points = 12;
  EXPECT_THAT(run(options), HasSubstr("no two frames share 15 tracks"));
  options.points = 200;
  options.frames = 1;
  EXPECT_THAT(run(options), HasSubstr("the clip has 1 frame"));
}

TEST(ColmapMapper, CountsAClipThatBreaksAsFailed) {
  const TempDir dir;
  const SyntheticTracks scene = MakeSyntheticTracks();
  // No track passes frame 12.
  std::vector<Observation> observations;
  for (Observation o : scene.file.tracks.observations()) {
    if (ToInt(o.frame) >= 12) o.feature = FeatureId{ToInt(o.feature) + 10'000};
    observations.push_back(o);
  }
  TrackFile file = scene.file;
  file.tracks = TrackSet::Build(std::move(observations));
  const ColmapResult result = ReconstructWithColmap(file, {}, dir / "work");
  EXPECT_EQ(result.summary.registered, 12u) << result.summary.Brief();
  EXPECT_EQ(result.summary.WhyFailed(), "12 of 24 frames have a pose, fewer than 80 %");
  EXPECT_THAT(result.summary.termination, HasSubstr("only 12 of 24 frames"));
}

TEST(ColmapMapper, LeavesPredictedPositionsOut) {
  const TempDir dir;
  const SyntheticTracks scene = MakeSyntheticTracks();
  std::vector<Observation> observations;
  for (Observation o : scene.file.tracks.observations()) {
    if ((ToInt(o.feature) + ToInt(o.frame)) % 4 == 0) {
      o.state = ObservationState::kPredicted;
      o.xy.x() += 60.0;  // would do harm
    }
    observations.push_back(o);
  }
  TrackFile file = scene.file;
  file.tracks = TrackSet::Build(std::move(observations));
  const ColmapResult result = ReconstructWithColmap(file, {}, dir / "work");
  EXPECT_EQ(result.summary.registered, 24u);
  EXPECT_LE(result.summary.observations, file.tracks.CountObserved());
  EXPECT_GT(result.summary.observations, file.tracks.CountObserved() * 95 / 100);
  EXPECT_LT(AbsoluteTrajectoryError(result.reconstruction.cam_from_world, scene.cam_from_world),
            0.01);
}

TEST(ColmapAdjuster, BringsAModelOfTheTracksToItsOptimum) {
  const TempDir dir;
  const SyntheticTracks scene = ClipWithOutliers(CameraPath::kLateral);
  Reconstruction start = TriangulateWithCeres(scene.file, scene.cam_from_world).reconstruction;
  const std::size_t points = start.points.size();
  RandomStream random(1, "test.adjuster");
  for (auto& [frame, pose] : start.cam_from_world) {
    pose.translation += Eigen::Vector3d::Constant(0.03 * random.Gaussian());
  }
  const double before = AbsoluteTrajectoryError(start.cam_from_world, scene.cam_from_world);
  const ColmapResult result = AdjustWithColmap(scene.file, start, {}, dir / "work");
  EXPECT_EQ(result.summary.registered, 30u) << result.summary.Brief();
  EXPECT_GT(result.reconstruction.points.size(), points * 9 / 10);
  EXPECT_LT(AbsoluteTrajectoryError(result.reconstruction.cam_from_world, scene.cam_from_world),
            0.5 * before);
}

// COLMAP's own tools take the model that we write.
// Text or binary of a model in a folder beside it, so that it is what COLMAP reads.
std::string OnlyFilesOf(const std::filesystem::path& model, const std::string& suffix) {
  const std::filesystem::path folder = model.string() + suffix;
  std::filesystem::create_directory(folder);
  for (const char* name : {"cameras", "images", "points3D"}) {
    std::filesystem::copy_file(model / (name + suffix), folder / (name + suffix));
  }
  return folder.string();
}

TEST(ModelFolder, IsReadByColmap) {
  const TempDir dir;
  const SyntheticTracks scene = ClipWithOutliers(CameraPath::kArc);
  const ColmapResult result = ReconstructWithColmap(scene.file, {}, dir / "work");
  WriteReconstruction(dir / "model", result.reconstruction);
  double mean_of_points_px = 0.0;
  for (const auto& [feature, point] : result.reconstruction.points) {
    mean_of_points_px +=
        point.mean_reprojection_px / static_cast<double>(result.reconstruction.points.size());
  }
  ColmapProgram program;
  for (const char* suffix : {".txt", ".bin"}) {
    const std::string folder = OnlyFilesOf(dir / "model", suffix);
    const auto log = dir / "analyzer.log";
    std::filesystem::remove(log);
    ASSERT_EQ(program.Run("model_analyzer", {{{"path"}, folder, true}}, log).exit_code, 0);
    const std::string text = ReadBytes(log);
    EXPECT_THAT(text, HasSubstr("Registered images: 30"));
    EXPECT_THAT(text, HasSubstr(fmt::format("Points: {}", result.summary.points)));
    EXPECT_THAT(text, HasSubstr(fmt::format("Observations: {}", result.summary.observations)));
    const std::string label = "Mean reprojection error: ";
    ASSERT_THAT(text, HasSubstr(label));
    EXPECT_NEAR(std::stod(text.substr(text.find(label) + label.size())), mean_of_points_px, 1e-5);
  }
  const auto log = dir / "tools.log";
  std::filesystem::create_directory(dir / "ply_out");
  EXPECT_EQ(program
                .Run("model_converter",
                     {{{"input_path"}, (dir / "model.txt").string(), true},
                      {{"output_path"}, (dir / "ply_out" / "a.ply").string(), true},
                      {{"output_type"}, "PLY", true}},
                     log)
                .exit_code,
            0);
  EXPECT_TRUE(std::filesystem::exists(dir / "ply_out" / "a.ply"));
  std::filesystem::create_directory(dir / "adjusted");
  EXPECT_EQ(program
                .Run("bundle_adjuster",
                     {{{"input_path"}, (dir / "model.bin").string(), true},
                      {{"output_path"}, (dir / "adjusted").string(), true},
                      {{"BundleAdjustment.refine_focal_length"}, "0"},
                      {{"BundleAdjustment.refine_extra_params"}, "0"}},
                     log)
                .exit_code,
            0);
  EXPECT_THAT(ReadBytes(log), Not(HasSubstr("WARNING")));
  // Adjusted already: it stays where it is, which pins the half pixel of camera and points alike.
  const Reconstruction adjusted = FromColmapModel(ReadColmapModel(dir / "adjusted"));
  EXPECT_LT(AbsoluteTrajectoryError(adjusted.cam_from_world, result.reconstruction.cam_from_world),
            1e-3);
  EXPECT_EQ(adjusted.points.size(), result.reconstruction.points.size());
}

// A true model without noise is adjusted by COLMAP and stays: its formulas and order are ours.
TEST(ModelFolder, OfAZoomIsReadByColmapWithACameraForEveryImage) {
  const TempDir dir;
  SyntheticTracksOptions options;
  options.noise_px = 0.0;
  options.camera = test::FreiburgCamera();
  const SyntheticTracks still = MakeSyntheticTracks(options);
  const FocalScales scales = test::ZoomOf(still.file.frames);
  Reconstruction model = test::ModelOfTruth(test::Zoomed(still, scales), scales);
  UpdateReprojectionErrors(model);
  WriteReconstruction(dir / "model", model);
  ColmapProgram program;
  const auto log = dir / "tools.log";
  for (const char* suffix : {".txt", ".bin"}) {
    const std::string folder = OnlyFilesOf(dir / "model", suffix);
    std::filesystem::remove(log);
    ASSERT_EQ(program.Run("model_analyzer", {{{"path"}, folder, true}}, log).exit_code, 0);
    EXPECT_THAT(ReadBytes(log), HasSubstr("Cameras: 24"));
    EXPECT_THAT(ReadBytes(log), HasSubstr("Registered images: 24"));
    const std::string converted = folder + "_converted";
    std::filesystem::create_directory(converted);
    ASSERT_EQ(program
                  .Run("model_converter",
                       {{{"input_path"}, folder, true},
                        {{"output_path"}, converted, true},
                        {{"output_type"}, "BIN", true}},
                       log)
                  .exit_code,
              0);
    const Reconstruction read = FromColmapModel(ReadColmapModel(converted));
    for (const auto& [frame, pose] : model.cam_from_world) {
      EXPECT_NEAR(CameraOf(read, frame).fx, CameraOf(model, frame).fx, 1e-9);
    }
  }
  // Each image is seen by its own camera: a model without errors stays where it is.
  const ColmapResult adjusted =
      AdjustWithColmap(test::Zoomed(still, scales).file, model, {}, dir / "work");
  EXPECT_LT(adjusted.summary.mean_reprojection_px, 1e-3);
  EXPECT_EQ(adjusted.reconstruction.focal_scale.size(), 24u);
  EXPECT_LT(AbsoluteTrajectoryError(adjusted.reconstruction.cam_from_world, still.cam_from_world),
            1e-4);
}

TEST(ModelFolder, CamerasOfManyCoefficientsAreWhatColmapTakesThemFor) {
  for (const Camera& camera :
       {test::FreiburgCamera(), test::RationalCamera(), test::FisheyeCamera()}) {
    const TempDir dir;
    SyntheticTracksOptions options;
    options.path = CameraPath::kLateral;
    options.frames = 8;
    options.points = 150;
    options.noise_px = 0.0;
    options.camera = camera;
    const SyntheticTracks scene = MakeSyntheticTracks(options);
    Reconstruction truth;
    truth.camera = camera;
    truth.cam_from_world = scene.cam_from_world;
    for (const auto& [feature, in_world] : scene.points_in_world) {
      if (scene.file.tracks.Track(feature).size() < 2) continue;  // COLMAP's adjuster aborts
      truth.points[feature].in_world = in_world;
      for (const Observation& o : scene.file.tracks.Track(feature)) {
        truth.points[feature].views.push_back({o.frame, o.xy});
      }
    }
    const auto folder = [&](const char* name) {
      std::filesystem::create_directory(dir / name);
      return (dir / name).string();
    };
    const std::string model = folder("model");
    WriteColmapModel(model, ToColmapModel(truth), ColmapModelFormat::kText);
    const std::string converted = folder("converted");
    const std::string adjusted = folder("adjusted");
    const auto log = dir / "log";
    ColmapProgram program;
    EXPECT_EQ(program.Run("model_analyzer", {{{"path"}, model, true}}, log).exit_code, 0);
    EXPECT_THAT(ReadBytes(log), HasSubstr("Registered images: 8"));
    EXPECT_EQ(program
                  .Run("model_converter",
                       {{{"input_path"}, model, true},
                        {{"output_path"}, converted, true},
                        {{"output_type"}, "BIN", true}},
                       log)
                  .exit_code,
              0);
    EXPECT_EQ(program
                  .Run("bundle_adjuster",
                       {{{"input_path"}, converted, true},
                        {{"output_path"}, adjusted, true},
                        {{"BundleAdjustment.refine_focal_length"}, "0"},
                        {{"BundleAdjustment.refine_extra_params"}, "0"}},
                       log)
                  .exit_code,
              0);
    EXPECT_THAT(ReadBytes(log), Not(HasSubstr("WARNING")));
    const Reconstruction result = FromColmapModel(ReadColmapModel(adjusted));
    EXPECT_EQ(result.camera.model, camera.model);
    EXPECT_EQ(result.camera.k3, camera.k3);
    EXPECT_EQ(result.camera.k6, camera.k6);
    EXPECT_EQ(result.points.size(), truth.points.size());
    for (const auto& [frame, pose] : truth.cam_from_world) {
      EXPECT_LT(AngleBetween(pose.rotation, result.cam_from_world.at(frame).rotation), 1e-7);
    }
    EXPECT_LT(AbsoluteTrajectoryError(result.cam_from_world, truth.cam_from_world), 1e-6);
  }
}

// What the Ceres backend writes goes on in COLMAP: both formats, adjusted and triangulated anew.
TEST(ModelFolder, OfTheCeresBackendIsAdjustedAndTriangulatedByColmap) {
  const TempDir dir;
  const SyntheticTracks scene = ClipWithOutliers(CameraPath::kArc);
  const MapperResult result = ReconstructWithCeres(scene.file);
  ASSERT_EQ(result.summary.registered, 30u) << result.summary.Brief();
  const auto ate = [&](const Reconstruction& model) {
    return AbsoluteTrajectoryError(model.cam_from_world, scene.cam_from_world);
  };
  WriteColmapDatabase(dir / "database.db", scene.file);
  std::filesystem::create_directory(dir / "images");
  ColmapProgram program;
  for (const ColmapModelFormat format : {ColmapModelFormat::kText, ColmapModelFormat::kBinary}) {
    const std::string name = format == ColmapModelFormat::kText ? "text" : "binary";
    const std::string model = dir / name;
    std::filesystem::create_directory(model);
    WriteColmapModel(model, ToColmapModel(result.reconstruction), format);
    const auto run = [&](const std::string& command, std::vector<ColmapArgument> arguments) {
      const auto log = dir / (name + command + ".log");
      arguments.push_back({{"input_path"}, model, true});
      const std::string output = dir / (name + command);
      std::filesystem::create_directory(output);
      arguments.push_back({{"output_path"}, output, true});
      EXPECT_EQ(program.Run(command, arguments, log).exit_code, 0) << ReadBytes(log);
      return FromColmapModel(ReadColmapModel(output));
    };
    const Reconstruction adjusted = run("bundle_adjuster",
                                        {{{"BundleAdjustment.refine_focal_length"}, "0"},
                                         {{"BundleAdjustment.refine_extra_params"}, "0"}});
    EXPECT_EQ(adjusted.points.size(), result.summary.points);
    EXPECT_NEAR(ate(adjusted), ate(result.reconstruction), 0.3 * ate(result.reconstruction));

    const Reconstruction triangulated =
        run("point_triangulator",
            {{{"database_path"}, (dir / "database.db").string(), true},
             {{"image_path"}, (dir / "images").string(), true},
             {{"clear_points"}, "1", true}});
    EXPECT_EQ(triangulated.cam_from_world.size(), 30u);
    EXPECT_GT(triangulated.points.size(), result.summary.points * 8 / 10);
  }
}

// What COLMAP says of databases that lack something; our wrapper's reading of it rests on this.
TEST(ColmapDatabase, FailsInColmapAsWeExpect) {
  const TempDir dir;
  std::filesystem::create_directory(dir / "images");
  const SyntheticTracks scene = MakeSyntheticTracks();
  ColmapProgram program;
  const auto log_of = [&](const ColmapDatabase& database) {
    WriteColmapDatabase(dir / "a.db", database);
    const auto log = dir / "a.log";
    std::filesystem::remove(log);
    program.Run("mapper",
                {{{"database_path"}, (dir / "a.db").string(), true},
                 {{"image_path"}, (dir / "images").string(), true},
                 {{"output_path"}, dir.path().string(), true},
                 {{"Mapper.num_threads"}, "1"}},
                log);
    return ReadBytes(log);
  };
  ColmapDatabase matches_only = BuildColmapDatabase(scene.file);
  for (auto& [ids, pair] : matches_only.pairs) pair.geometry.reset();
  EXPECT_THAT(log_of(matches_only), HasSubstr("No images with matches"));
  ColmapDatabaseOptions chain;
  chain.max_stride = 1;
  EXPECT_THAT(log_of(BuildColmapDatabase(scene.file, chain)),
              HasSubstr("No good initial image pair found"));
}

TEST(ColmapProgram, SaysHowToGetColmap) {
  const TempDir dir;
  EXPECT_THAT([] { ColmapProgram("no-such-colmap"); },
              ThrowsMessage<Error>(testing::AllOf(HasSubstr("colmap is not installed"),
                                                  HasSubstr("apt install colmap"),
                                                  HasSubstr("--colmap-program"))));
  EXPECT_THAT([] { ColmapProgram("/bin/true"); },
              ThrowsMessage<Error>(HasSubstr("is not COLMAP (its -h prints nothing)")));
  ColmapOptions options;
  options.program = (dir / "colmap").string();
  EXPECT_THAT([&] { ReconstructWithColmap(MakeSyntheticTracks().file, options, dir / "work"); },
              ThrowsMessage<Error>(HasSubstr("colmap is not installed")));
  EXPECT_FALSE(std::filesystem::exists(dir / "work"));
}

// A program that answers as another COLMAP would.
class FakeColmap {
 public:
  explicit FakeColmap(const std::string& body) : path_(dir_ / "colmap") {
    WriteBytes(path_, "#!/bin/sh\n" + body);
    std::filesystem::permissions(path_, std::filesystem::perms::owner_all);
  }
  std::string path() const { return path_.string(); }
  std::filesystem::path log() const { return dir_ / "log"; }

 private:
  TempDir dir_;
  std::filesystem::path path_;
};

TEST(ColmapProgram, AsksForTheNamesOfOptions) {
  const FakeColmap fake(
      "case \"$*\" in\n"
      "'-h') echo 'COLMAP 4.2.0.dev0 (Commit x)' ;;\n"
      "'mapper -h') echo '  --database_path arg'; echo '  --Mapper.new_name arg (=1)' ;;\n"
      "*) echo ran \"$@\"; echo input $(wc -c); echo $QT_QPA_PLATFORM ;;\nesac\n");
  ColmapProgram program(fake.path());
  EXPECT_EQ(program.version(), "4.2.0.dev0");
  const ProgramEnd end = program.Run("mapper",
                                     {{{"database_path"}, "a b.db", true},
                                      {{"Mapper.old_name", "Mapper.new_name"}, "3"},
                                      {{"Mapper.gone"}, "1"}},
                                     fake.log());
  EXPECT_EQ(end.Brief(), "exit code 0");
  const std::string log = ReadBytes(fake.log());
  EXPECT_THAT(log, HasSubstr("\nran mapper --database_path a b.db --Mapper.new_name 3\n"));
  EXPECT_THAT(log, HasSubstr("not known to this COLMAP: --Mapper.gone"));
  EXPECT_THAT(log, HasSubstr("input 0\noffscreen"));
  EXPECT_THAT(
      [&] {
        program.Run("mapper", {{{"output_path"}, "x", true}}, fake.log());
      },
      ThrowsMessage<Error>(HasSubstr("has no option --output_path")));
}

TEST(ColmapProgram, TellsAKilledProgram) {
  const FakeColmap fake(
      "case \"$*\" in\n'-h') echo COLMAP 3.8 ;;\n*-h) ;;\n*) kill -ABRT $$ ;;\nesac\n");
  ColmapProgram program(fake.path());
  EXPECT_EQ(program.Run("mapper", {}, fake.log()).Brief(), "killed by signal 6");
  const FakeColmap crashing("kill -SEGV $$\n");
  EXPECT_THAT([&] { ColmapProgram(crashing.path()); },
              ThrowsMessage<Error>(HasSubstr("colmap -h was killed by signal 11")));
  const FakeColmap incomplete("echo colmap: cannot find libceres.so.3; exit 127\n");
  EXPECT_THAT([&] { ColmapProgram(incomplete.path()); },
              ThrowsMessage<Error>(HasSubstr("its -h prints 'colmap: cannot find libceres.so.3'")));
}

TEST(ColmapProgram, ThatHangsIsKilledAtItsTimeLimit) {
  constexpr double kLimitMinutes = 0.005;
  const FakeColmap fake(
      "case \"$*\" in\n'-h') echo COLMAP 3.8 ;;\n*-h) ;;\n*) exec sleep 60 ;;\nesac\n");
  ColmapProgram program(fake.path(), kLimitMinutes);
  EXPECT_THAT([&] { program.Run("mapper", {}, fake.log()); },
              ThrowsMessage<Error>(testing::AllOf(HasSubstr("mapper had not ended after 0.005"),
                                                  HasSubstr("--colmap.max-minutes"))));
  const FakeColmap mute("exec sleep 60\n");
  EXPECT_THAT([&] { ColmapProgram(mute.path(), kLimitMinutes); },
              ThrowsMessage<Error>(HasSubstr("hangs")));
}

TEST(ColmapProgram, WhoseHelpHasNoEndIsKilled) {
  const FakeColmap endless("exec yes COLMAP 3.8\n");
  EXPECT_THAT([&] { ColmapProgram(endless.path()); },
              ThrowsMessage<Error>(HasSubstr("the output of -h does not end")));
}

TEST(ColmapProgram, ReadsAHelpWithWordsOfAnyLength) {
  const std::string digits = "head -c 1000000 /dev/zero | tr '\\0' 7";
  const FakeColmap fake(fmt::format(
      "case \"$*\" in\n'-h') echo 'No COLMAPs, COLMAP'; echo ' COLMAP  v3.9-dev (of COLMAP 4)' ;;\n"
      "*-h) printf -- '--a.b_1=x ---c --9 -- --'; {} | tr 7 d; {} | tr 7 - ;;\nesac\n",
      digits,
      digits));
  ColmapProgram program(fake.path());
  EXPECT_EQ(program.version(), "3.9-dev");
  EXPECT_THAT(program.Options("mapper"),
              testing::UnorderedElementsAre("a.b_1", "c", std::string(1'000'000, 'd')));
  const FakeColmap endless(fmt::format("printf 'COLMAP 3'; {}\n", digits));
  EXPECT_EQ(ColmapProgram(endless.path()).version(), "3" + std::string(39, '7'));
}

// A program that answers as COLMAP does, and leaves files of nonsense.
TEST(ColmapMapper, NonsenseThatTheProgramWritesIsAnError) {
  const TempDir dir;
  SyntheticTracksOptions small;
  small.frames = 6;
  const TrackFile tracks = MakeSyntheticTracks(small).file;
  ColmapOptions options;
  for (const char* nonsense : {"printf 'lies lies lies lies lies lies lies'",
                               "head -c 10000 /dev/zero | tr '\\0' '\\377'",
                               "head -c 10000 /dev/zero"}) {
    const FakeColmap fake(
        fmt::format("case \"$*\" in\n'-h') echo COLMAP 3.8 ;;\n"
                    "*-h) echo --database_path --image_path --output_path ;;\n"
                    "*) printf '\\377\\n\\033[2J Check failed \\376'\n"
                    "for last; do :; done; mkdir -p \"$last/0\"\n"
                    "for f in cameras images points3D; do {} > \"$last/0/$f.bin\"; done ;;\nesac\n",
                    nonsense));
    options.program = fake.path();
    EXPECT_THAT([&] { ReconstructWithColmap(tracks, options, dir / "work"); },
                ThrowsMessage<Error>(testing::AnyOf(HasSubstr(".bin"), HasSubstr("0 cameras"))))
        << nonsense;
  }
}

// Whether a process is gone, or dead and waiting for whoever inherited it.
bool HasEnded(const std::string& pid) {
  std::ifstream stat("/proc/" + pid + "/stat");
  std::string text;
  return !std::getline(stat, text) || text.find(") Z") != std::string::npos;
}

TEST(ColmapProgram, DiesWithUs) {
  const FakeColmap fake(
      "case \"$*\" in\n'-h') echo COLMAP 3.8 ;;\n*-h) ;;\n"
      "*) echo $$ > \"$0.pid.partial\"; mv \"$0.pid.partial\" \"$0.pid\"; exec sleep 60 "
      ";;\nesac\n");
  const pid_t ours = fork();
  ASSERT_GE(ours, 0);
  if (ours == 0) {
    ColmapProgram(fake.path()).Run("mapper", {}, fake.log());
    _exit(0);
  }
  const std::string pid_file = fake.path() + ".pid";
  while (!std::filesystem::exists(pid_file)) usleep(1000);
  std::string pid = ReadBytes(pid_file);
  pid.pop_back();
  EXPECT_FALSE(HasEnded(pid));
  kill(ours, SIGKILL);
  waitpid(ours, nullptr, 0);
  for (int i = 0; i < 5000 && !HasEnded(pid); ++i) usleep(1000);
  EXPECT_TRUE(HasEnded(pid));
}

TEST(ColmapMapper, AProgramThatSucceedsAndRegistersNothingHasFailed) {
  const TempDir dir;
  const FakeColmap fake(
      "case \"$*\" in\n'-h') echo COLMAP 3.8 ;;\n"
      "*-h) echo --database_path --image_path --output_path ;;\n*) exit 0 ;;\nesac\n");
  ColmapOptions options;
  options.program = fake.path();
  SyntheticTracksOptions small;
  small.frames = 6;
  const ColmapResult result =
      ReconstructWithColmap(MakeSyntheticTracks(small).file, options, dir / "work");
  EXPECT_TRUE(result.summary.Failed());
  EXPECT_THAT(result.summary.termination,
              testing::AllOf(HasSubstr("COLMAP 3.8 registered no frame: exit code 0"),
                             HasSubstr("colmap.log")));
}

// The real program, whose output a stage then loses in part.
TEST(ColmapMapper, WhatLosesItsPointsIsNoModelAndNoAdjustment) {
  const TempDir dir;
  SyntheticTracksOptions small;
  small.frames = 8;
  const TrackFile tracks = MakeSyntheticTracks(small).file;
  const auto losing = [](const char* stage, const char* folder, int exit_code) {
    return fmt::format(
        "colmap \"$@\" || exit $?\n[ \"$1\" = {} ] || exit 0\nfor last; do :; done\n"
        "[ -d \"$last{}\" ] || exit 0\n{}exit {}\n",
        stage,
        folder,
        exit_code == 0 ? fmt::format("head -c 8 /dev/zero > \"$last{}/points3D.bin\"\n", folder)
                       : "",
        exit_code);
  };
  ColmapOptions options;
  const auto reconstruct = [&](const char* stage, const char* folder, int exit_code) {
    const FakeColmap fake(losing(stage, folder, exit_code));
    options.program = fake.path();
    return ReconstructWithColmap(tracks, options, dir / "work");
  };
  const ColmapResult none = reconstruct("mapper", "/0", 0);
  EXPECT_TRUE(none.summary.Failed());
  EXPECT_THAT(none.summary.termination, HasSubstr("its model has no points"));
  const ColmapResult as_it_was = reconstruct("bundle_adjuster", "", 0);
  EXPECT_EQ(as_it_was.summary.registered, 8u);
  EXPECT_GT(as_it_was.summary.points, 50u);
  const FakeColmap adjuster(losing("bundle_adjuster", "", 0));
  options.program = adjuster.path();
  EXPECT_THAT(AdjustWithColmap(tracks, as_it_was.reconstruction, options, dir / "adjust")
                  .summary.termination,
              HasSubstr("could not adjust"));
  const ColmapResult died = reconstruct("mapper", "/0", 3);
  EXPECT_EQ(died.summary.registered, 8u);
  EXPECT_THAT(died.summary.termination, HasSubstr("though its mapper ended with exit code 3"));
}

// A program that is killed, or whose disk is full, leaves the beginnings of a model.
TEST(ColmapMapper, ADeathWhileItWritesLosesNoOtherModel) {
  const TempDir dir;
  SyntheticTracksOptions small;
  small.frames = 8;
  const TrackFile tracks = MakeSyntheticTracks(small).file;
  ColmapOptions options;
  const auto reconstruct = [&](const std::string& body) {
    const FakeColmap fake(body);
    options.program = fake.path();
    return ReconstructWithColmap(tracks, options, dir / "work");
  };
  const char* half = "for last; do :; done\n{}printf half > \"$last{}/images.bin\"\nexit 137\n";
  const auto dying = [&](const char* call, const char* folder) {
    return fmt::format("colmap \"$@\" || exit $?\ncase \"$*\" in {}) ;; *) exit 0 ;; esac\n",
                       call) +
           fmt::format(fmt::runtime(half), "", folder);
  };
  const ColmapResult other = reconstruct(dying("'mapper '*sparse0", "/0"));
  EXPECT_EQ(other.summary.registered, 8u) << other.summary.Brief();
  EXPECT_THAT(other.summary.termination,
              testing::AllOf(HasSubstr("done, a mapper run that ended with exit code 137"),
                             HasSubstr("images.bin")));
  const ColmapResult none = reconstruct(dying("'mapper --'*", "/0"));
  EXPECT_TRUE(none.summary.Failed());
  EXPECT_THAT(none.summary.termination,
              testing::AllOf(HasSubstr("registered no frame"), HasSubstr("images.bin")));
  const ColmapResult mapped = reconstruct(dying("'bundle_adjuster --'*", ""));
  EXPECT_EQ(mapped.summary.registered, 8u);
  EXPECT_GT(mapped.summary.points, 50u);
  EXPECT_THAT(mapped.summary.termination, HasSubstr("though its bundle_adjuster failed"));
  const ColmapResult unlike = reconstruct(
      "colmap \"$@\" || exit $?\ncase \"$*\" in 'bundle_adjuster --'*) ;; *) exit 0 ;; esac\n"
      "for last; do :; done\nrm \"$last\"/*.bin\ncd \"$last\"\n"
      "echo '1 PINHOLE 640 480 500 500 320 240' > cameras.txt\n"
      "echo '2 PINHOLE 640 480 400 400 320 240' >> cameras.txt\n"
      "printf '1 1 0 0 0 0 0 0 1 a.png\\n\\n2 1 0 0 0 0 0 0 2 b.png\\n\\n' > images.txt\n"
      "touch points3D.txt points3D.bin\n");
  EXPECT_EQ(unlike.summary.registered, 8u);
  EXPECT_THAT(unlike.summary.termination, HasSubstr("though its bundle_adjuster failed"));
  const FakeColmap adjuster(dying("'bundle_adjuster --'*", ""));
  options.program = adjuster.path();
  EXPECT_THAT(
      AdjustWithColmap(tracks, mapped.reconstruction, options, dir / "adjust").summary.termination,
      HasSubstr("could not adjust"));
}

// Of a clip whose best pair leads nowhere.
TEST(ColmapMapper, SaysWhereTheModelThatItReturnsBegan) {
  const TempDir dir;
  SyntheticTracksOptions small;
  small.frames = 12;
  const TrackFile tracks = MakeSyntheticTracks(small).file;
  ColmapOptions options;
  const InitialPairs found = FindInitialPairs(tracks, *tracks.camera, options.max_attempts);
  ASSERT_GT(found.ranked.size(), 1u);
  const std::string first = DescribeInitialPair(found.ranked.front());
  const auto termination_without = [&](const char* calls) {
    const FakeColmap fake(
        fmt::format("case \"$*\" in {}) exit 1 ;; esac\nexec colmap \"$@\"\n", calls));
    options.program = fake.path();
    return ReconstructWithColmap(tracks, options, dir / "work").summary.termination;
  };
  EXPECT_THAT(termination_without("-"), HasSubstr(first));
  EXPECT_THAT(termination_without("'mapper --'*sparse0"),
              testing::AllOf(HasSubstr("initial pair: frames"), Not(HasSubstr(first))));
  EXPECT_THAT(termination_without("'mapper --'*--Mapper.init_image_id1*"),
              HasSubstr("initial pair: chosen by COLMAP"));
}

TEST(AdjustWithColmap, TakesWhatItsMapperWouldGetAlone) {
  const TempDir dir;
  SyntheticTracksOptions small;
  small.frames = 8;
  TrackFile tracks = MakeSyntheticTracks(small).file;
  std::vector<Observation> observations(tracks.tracks.observations().begin(),
                                        tracks.tracks.observations().end());
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const float variance = i % 5 == 0 ? 9.0F : 0.1F;
    observations[i].covariance = PixelCovariance{variance, 0.0F, variance};
  }
  tracks.tracks = TrackSet::Build(observations);
  const Reconstruction start = ReconstructWithCeres(tracks).reconstruction;
  const ColmapResult result = AdjustWithColmap(tracks, start, {}, dir / "work");
  ASSERT_GT(result.summary.observations, 500u);
  for (const auto& [feature, point] : result.reconstruction.points) {
    for (const PointView& view : point.views) {
      EXPECT_LT(tracks.tracks.Find(feature, view.frame)->covariance->xx, 1.0F);
    }
  }
}

// A texture of smooth blobs, moved by 5 px a frame, as COLMAP reads it.
void WriteMovingTexture(const std::filesystem::path& folder, int frames) {
  std::filesystem::create_directory(folder);
  for (int f = 0; f < frames; ++f) {
    std::string picture = "P5\n200 150\n255\n";
    for (int y = 0; y < 150; ++y) {
      for (int x = 0; x < 200; ++x) {
        const double u = x + 5.0 * f;
        const double value = std::sin(0.31 * u + 2.0 * std::sin(0.07 * y)) *
                                 std::sin(0.27 * y + 3.0 * std::sin(0.05 * u)) +
                             0.7 * std::sin(0.011 * u * y / 9.0);
        picture += static_cast<char>(std::clamp(127.0 + 70.0 * value, 0.0, 255.0));
      }
    }
    WriteBytes(folder / fmt::format("{}.pgm", f), picture);
  }
}

TEST(ColmapProgram, ItsOwnDatabaseIsRead) {
  const TempDir dir;
  WriteMovingTexture(dir / "images", 3);
  ColmapProgram program;
  const std::string database = (dir / "own.db").string();
  program.Run("feature_extractor",
              {{{"database_path"}, database, true},
               {{"image_path"}, (dir / "images").string(), true},
               {{"ImageReader.single_camera"}, "1", true},
               {{"SiftExtraction.use_gpu", "FeatureExtraction.use_gpu"}, "0", true}},
              dir / "log");
  program.Run("exhaustive_matcher",
              {{{"database_path"}, database, true},
               {{"SiftMatching.use_gpu", "FeatureMatching.use_gpu"}, "0", true}},
              dir / "log");
  const ColmapDatabase read = ReadColmapDatabase(database);
  EXPECT_EQ(read.camera.width_px, 200);
  ASSERT_EQ(read.images.size(), 3u);
  for (const auto& [id, image] : read.images) EXPECT_GT(image.keypoints.size(), 20u) << image.name;
  ASSERT_EQ(read.pairs.size(), 3u);
  for (const auto& [ids, pair] : read.pairs) {
    EXPECT_GT(pair.matches.size(), 10u);
    // COLMAP writes poses only on request.
    if (pair.geometry) {
      EXPECT_FALSE(pair.geometry->cam2_from_cam1);
    }
  }

  // Its verified matches are tracks of the picture's shift.
  const std::vector<FrameInfo> frames = {
      {FrameIndex{0}, "0.pgm", 0}, {FrameIndex{1}, "1.pgm", 0}, {FrameIndex{2}, "2.pgm", 0}};
  const TrackSet tracks = TracksOfColmapDatabase(read, frames, database).tracks;
  EXPECT_GT(tracks.features().size(), 20u);
  std::vector<double> off;
  for (const FeatureId feature : tracks.features()) {
    const auto track = tracks.Track(feature);
    ASSERT_GE(track.size(), 2u);
    const double frames_apart = ToInt(track.back().frame) - ToInt(track.front().frame);
    const Eigen::Vector2d moved = track.back().xy - track.front().xy;
    off.push_back((moved - Eigen::Vector2d(-5.0 * frames_apart, 0.0)).norm());
  }
  EXPECT_LT(Median(std::move(off)), 0.3);
}

// The index of a keypoint is that in points2D of the model that COLMAP makes, as the example for
// pycolmap takes it.
TEST(KeypointCovariances, JoinTheModelThatColmapMakesOfTheDatabase) {
  const TempDir dir;
  TrackFile file = ClipWithOutliers(CameraPath::kArc).file;
  std::vector<Observation> observations(file.tracks.observations().begin(),
                                        file.tracks.observations().end());
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const float size = 0.1F + 0.0001F * static_cast<float>(i % 1000);
    if (i % 17 != 0) observations[i].covariance = PixelCovariance{size, 0.01F, size};
  }
  file.tracks = TrackSet::Build(std::move(observations));
  WriteColmapDatabase(dir / "a.db", file);
  const CovarianceCounts counts = WriteKeypointCovariances(dir / "a.npz", file);
  std::filesystem::create_directory(dir / "models");
  std::filesystem::create_directory(dir / "images");
  ColmapProgram program;
  ASSERT_EQ(program
                .Run("mapper",
                     {{{"database_path"}, (dir / "a.db").string(), true},
                      {{"image_path"}, (dir / "images").string(), true},
                      {{"output_path"}, (dir / "models").string(), true}},
                     dir / "log")
                .exit_code,
            0);
  const auto largest = ReadLargestColmapModel(dir / "models");
  ASSERT_TRUE(largest);
  EXPECT_EQ(largest->model.images.size(), 30u);
  WriteColmapModel(dir.path(), largest->model, ColmapModelFormat::kText);
  const std::string printed = test::RunNumpy(
      dir.path(),
      "import sys\n"
      "sys.path.insert(0, '" +
          (test::SourceDir() / "docs/examples").string() +
          "')\n"
          "import adjust_with_covariances as example\n"
          "measured = example.covariances('a.npz')\n"
          "lines = [line for line in open('images.txt') if not line.startswith('#')]\n"
          "points = found = 0\n"
          "for head, body in zip(lines[::2], lines[1::2]):\n"
          "  name, numbers = head.split()[9], body.split()\n"
          "  for k in range(len(numbers) // 3):\n"
          "    xy = np.array([float(numbers[3 * k]), float(numbers[3 * k + 1])])\n"
          "    covariance = example.covariance_of(measured, name, k, xy)\n"
          "    points += 1\n"
          "    found += (name, k) in measured\n"
          "    size = measured[name, k][1][0, 0] if (name, k) in measured else 1.0\n"
          "    assert abs(covariance[0, 0] - size - 0.01) < 1e-9\n"
          "print(points, found)\n"
          "name, k = next(iter(measured))\n"
          "try: example.covariance_of(measured, name, k, np.array([-9.0, 5.0]))\n"
          "except SystemExit as error: print(error)");
  EXPECT_THAT(printed,
              testing::StartsWith(
                  fmt::format("{} {}\n", counts.keypoints, counts.keypoints - counts.without)));
  EXPECT_THAT(printed, HasSubstr("in the model, at"));
}

}  // namespace
}  // namespace cohort
