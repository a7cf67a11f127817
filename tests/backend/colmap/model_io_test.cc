#include "backend/colmap/model_io.h"
#include "backend/colmap/tracks_to_database.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>

#include "frontend/storage/output.h"
#include "tests/support/cameras.h"
#include "tests/support/synthetic_tracks.h"
#include "tests/support/temp_dir.h"
#include "tests/support/zoom.h"

namespace cohort {
namespace {

using test::MakeSyntheticTracks;
using test::SyntheticTracks;
using test::SyntheticTracksOptions;
using test::TempDir;
using testing::HasSubstr;
using testing::ThrowsMessage;

Reconstruction TrueReconstruction(const SyntheticTracks& scene) {
  Reconstruction reconstruction;
  reconstruction.camera = *scene.file.camera;
  reconstruction.cam_from_world = scene.cam_from_world;
  for (const FrameInfo& frame : scene.file.frames) {
    reconstruction.frame_names[frame.index] = "rgb/" + frame.name;
    reconstruction.timestamps_ns[frame.index] = 1'700'000'000'123'456'789 + frame.timestamp_ns;
  }
  for (const auto& [feature, in_world] : scene.points_in_world) {
    Point3D& point = reconstruction.points[feature];
    point.in_world = in_world;
    point.mean_reprojection_px = 0.25 + ToInt(feature) * 0.001;
    for (const Observation& o : scene.file.tracks.Track(feature)) {
      point.views.push_back({o.frame, o.xy});
    }
  }
  return reconstruction;
}

SyntheticTracks SmallScene(const Camera& camera) {
  SyntheticTracksOptions options;
  options.camera = camera;
  options.frames = 5;
  options.points = 20;
  options.first_frame = 7;
  options.frame_stride = 2;
  return MakeSyntheticTracks(options);
}

SyntheticTracks SmallScene() {
  Camera camera = SyntheticTracksOptions::DefaultCamera();
  camera.k1 = -0.1;
  return SmallScene(camera);
}

void ExpectSame(const Reconstruction& a, const Reconstruction& b) {
  EXPECT_EQ(a.camera.fx, b.camera.fx);
  EXPECT_EQ(a.camera.cx, b.camera.cx);
  EXPECT_EQ(a.camera.k1, b.camera.k1);
  EXPECT_EQ(a.camera.k3, b.camera.k3);
  EXPECT_EQ(a.camera.k6, b.camera.k6);
  EXPECT_EQ(a.camera.model, b.camera.model);
  EXPECT_EQ(a.frame_names, b.frame_names);
  ASSERT_EQ(a.cam_from_world.size(), b.cam_from_world.size());
  for (const auto& [frame, pose] : a.cam_from_world) {
    EXPECT_LT(AngleBetween(pose.rotation, b.cam_from_world.at(frame).rotation), 1e-12);
    EXPECT_EQ(pose.translation, b.cam_from_world.at(frame).translation);
  }
  ASSERT_EQ(a.points.size(), b.points.size());
  for (const auto& [feature, point] : a.points) {
    const Point3D& other = b.points.at(feature);
    EXPECT_EQ(point.in_world, other.in_world);
    EXPECT_EQ(point.mean_reprojection_px, other.mean_reprojection_px);
    ASSERT_EQ(point.views.size(), other.views.size());
    for (std::size_t i = 0; i < point.views.size(); ++i) {
      EXPECT_EQ(point.views[i].frame, other.views[i].frame);
      EXPECT_LT((point.views[i].xy - other.views[i].xy).norm(), 1e-12);
    }
  }
}

TEST(ColmapModel, MemoryTextAndBinaryAgree) {
  for (const SyntheticTracks& scene : {SmallScene(),
                                       SmallScene(test::FreiburgCamera()),
                                       SmallScene(test::RationalCamera()),
                                       SmallScene(test::FisheyeCamera())}) {
    const TempDir dir;
    const Reconstruction truth = TrueReconstruction(scene);
    const ColmapModel model = ToColmapModel(truth);
    ExpectSame(FromColmapModel(model), truth);
    for (const auto format : {ColmapModelFormat::kText, ColmapModelFormat::kBinary}) {
      const auto folder = dir / (format == ColmapModelFormat::kText ? "txt" : "bin");
      std::filesystem::create_directory(folder);
      WriteColmapModel(folder, model, format);
      ExpectSame(FromColmapModel(ReadColmapModel(folder)), truth);
    }
  }
}

// As COLMAP makes them without --ImageReader.single_camera.
TEST(ColmapModel, CamerasThatAreAlikeAreOne) {
  const Reconstruction truth = TrueReconstruction(SmallScene());
  ColmapModel model = ToColmapModel(truth);
  for (auto& [id, image] : model.images) {
    model.cameras[10 + id] = model.cameras.at(1);
    image.camera_id = 10 + id;
  }
  const Reconstruction read = FromColmapModel(model);
  EXPECT_EQ(read.camera.fx, truth.camera.fx);
  EXPECT_EQ(read.cam_from_world.size(), truth.cam_from_world.size());
  EXPECT_EQ(read.points.size(), truth.points.size());
  model.cameras.rbegin()->second.params[0] += 1.0;
  EXPECT_THAT([&] { FromColmapModel(model); }, ThrowsMessage<Error>(HasSubstr("has one for all")));
}

TEST(ColmapModel, EveryImageOfAZoomHasACameraOfItsOwn) {
  Camera guess = Camera::Guess(640, 480);
  guess.k1 = -0.1;
  for (const SyntheticTracks& scene : {SmallScene(guess),
                                       SmallScene(test::FreiburgCamera()),
                                       SmallScene(test::RationalCamera()),
                                       SmallScene(test::FisheyeCamera())}) {
    const TempDir dir;
    Reconstruction truth = TrueReconstruction(scene);
    truth.focal_scale = test::ZoomOf(scene.file.frames);
    const ColmapModel model = ToColmapModel(truth);
    EXPECT_EQ(model.cameras.size(), model.images.size());
    for (const auto& [id, image] : model.images) EXPECT_EQ(image.camera_id, id);
    for (const auto format : {ColmapModelFormat::kText, ColmapModelFormat::kBinary}) {
      const auto folder = dir / (format == ColmapModelFormat::kText ? "txt" : "bin");
      std::filesystem::create_directory(folder);
      WriteColmapModel(folder, model, format);
      const Reconstruction read = FromColmapModel(ReadColmapModel(folder));
      // Of five frames the third has the median focal length, which is that of the camera here.
      ExpectSame(read, truth);
      for (const auto& [frame, pose] : truth.cam_from_world) {
        const Camera of_frame = CameraOf(truth, frame);
        EXPECT_NEAR(CameraOf(read, frame).fx, of_frame.fx, 1e-9);
        EXPECT_NEAR(CameraOf(read, frame).fy, of_frame.fy, 1e-9);
      }
    }
  }
}

TEST(ColmapModel, CamerasThatDifferInMoreThanTheFocalLengthAreNotOne) {
  Reconstruction truth = TrueReconstruction(SmallScene(test::FreiburgCamera()));
  truth.focal_scale[truth.cam_from_world.begin()->first] = 1.5;
  const auto fails = [&truth](const auto& change) {
    ColmapModel model = ToColmapModel(truth);
    EXPECT_FALSE(ShareCamera(model).other);
    change(model.cameras.rbegin()->second);
    EXPECT_EQ(ShareCamera(model).other, model.images.rbegin()->first);
    EXPECT_THAT([&] { FromColmapModel(model); },
                ThrowsMessage<Error>(HasSubstr("has one for all")));
  };
  fails([](ColmapCamera& camera) { camera.params[1] += 1.0; });  // fy alone
  fails([](ColmapCamera& camera) { camera.params[2] += 0.2; });
  fails([](ColmapCamera& camera) { camera.params.back() += 1e-2; });
  fails([](ColmapCamera& camera) { camera.width_px += 1; });
}

// As programs write them that have a camera for each image, in their own model and to their own
// digits.
TEST(ColmapModel, CamerasThatDifferByLessThanATenthOfAPixelAreOne) {
  const Reconstruction truth = TrueReconstruction(SmallScene(test::FreiburgCamera()));
  ColmapModel model = ToColmapModel(truth);
  const ColmapCamera camera = model.cameras.begin()->second;
  for (auto& [id, image] : model.images) {
    image.camera_id = id;
    model.cameras[id] = camera;
    model.cameras[id].params[0] += 0.01 * (id % 3);
    model.cameras[id].params[2] -= 0.02 * (id % 2);
  }
  ColmapCamera& other = model.cameras.rbegin()->second;
  other = camera;
  other.model = ColmapCameraModel::kFullOpencv;
  other.params.resize(ColmapParameterCount(other.model), 0.0);
  const Reconstruction read = FromColmapModel(model);
  EXPECT_TRUE(read.focal_scale.empty());
  EXPECT_NEAR(read.camera.fx, truth.camera.fx, 0.03);
  EXPECT_EQ(read.cam_from_world.size(), truth.cam_from_world.size());
}

TEST(ColmapModel, PointsLieHalfAPixelFurtherThanOurs) {
  const Reconstruction truth = TrueReconstruction(SmallScene());
  const ColmapModel model = ToColmapModel(truth);
  EXPECT_DOUBLE_EQ(model.cameras.at(1).params[2], truth.camera.cx + 0.5);
  const auto& [feature, point] = *truth.points.begin();
  const auto& [image, index] = model.points.at(ToInt(feature) + 1u).track[0];
  EXPECT_EQ(image, ToInt(point.views[0].frame) + 1);
  EXPECT_DOUBLE_EQ(model.images.at(image).points2d[index].xy.x(), point.views[0].xy.x() + 0.5);
}

TEST(ColmapModel, TextFillsTheErrorColumn) {
  const TempDir dir;
  const Reconstruction truth = TrueReconstruction(SmallScene());
  WriteColmapModel(dir.path(), ToColmapModel(truth), ColmapModelFormat::kText);
  const auto& [feature, point] = *truth.points.begin();
  EXPECT_THAT(ReadBytes(dir / "points3D.txt"),
              HasSubstr(fmt::format(" 200 200 200 {} ", point.mean_reprojection_px)));
}

TEST(ColmapModel, MapsAMappersPointsToFeatures) {
  const SyntheticTracks scene = SmallScene();
  const Reconstruction truth = TrueReconstruction(scene);
  // As the mapper writes it: all keypoints of an image, its own point ids.
  ColmapModel model;
  model.cameras[1] = ToColmapCamera(truth.camera);
  for (const auto& [frame, pose] : truth.cam_from_world) {
    ColmapModelImage& image = model.images[ColmapImageIdOf(frame)];
    image.cam_from_world = pose;
    image.name = truth.frame_names.at(frame);
    for (const Observation* o : ColmapKeypoints(scene.file.tracks, frame)) {
      const std::uint64_t id = 1000 - ToInt(o->feature);
      model.points[id].xyz = truth.points.at(o->feature).in_world;
      model.points[id].error_px = truth.points.at(o->feature).mean_reprojection_px;
      model.points[id].track.emplace_back(ColmapImageIdOf(frame),
                                          static_cast<std::uint32_t>(image.points2d.size()));
      image.points2d.push_back({o->xy + Eigen::Vector2d(0.5, 0.5), id});
    }
  }
  const Reconstruction read = FromColmapModel(model, scene.file);
  ExpectSame(read, truth);
  EXPECT_EQ(read.timestamps_ns.at(FrameIndex{9}), scene.file.frames[1].timestamp_ns);

  // A second, shorter point of one feature.
  ColmapModel split = model;
  split.points[5000] = model.points.begin()->second;
  split.points[5000].track.resize(2);
  split.points[5000].xyz.setZero();
  ExpectSame(FromColmapModel(split, scene.file), truth);

  model.points.begin()->second.track[0].second += 1;
  EXPECT_THAT([&] { FromColmapModel(model, scene.file); },
              ThrowsMessage<Error>(HasSubstr("not made from these tracks")));
}

TEST(ModelFolder, HoldsModelTrajectoryAndPoints) {
  const TempDir dir;
  const Reconstruction truth = TrueReconstruction(SmallScene());
  WriteReconstruction(dir / "model", truth);
  for (const char* name : {"cameras.txt",
                           "images.txt",
                           "points3D.txt",
                           "cameras.bin",
                           "images.bin",
                           "points3D.bin",
                           "trajectory.tum",
                           "points.ply"}) {
    EXPECT_TRUE(std::filesystem::exists(dir / "model" / name)) << name;
  }
  const Reconstruction read = ReadReconstruction(dir / "model");
  ExpectSame(read, truth);
  EXPECT_EQ(read.timestamps_ns, truth.timestamps_ns);
}

TEST(ModelFolder, TrajectoryIsWorldFromCamInEightFields) {
  const TempDir dir;
  const Reconstruction truth = TrueReconstruction(SmallScene());
  WriteReconstruction(dir / "model", truth);
  std::istringstream lines(ReadBytes(dir / "model" / "trajectory.tum"));
  std::string line;
  std::getline(lines, line);
  EXPECT_THAT(line, testing::StartsWith("1700000000.356790120 "));  // .123456789 + 7 * .033333333
  EXPECT_EQ(std::count(line.begin(), line.end(), ' '), 7);
  std::istringstream fields(line);
  double t, x, y, z;
  fields >> t >> x >> y >> z;
  const Eigen::Vector3d centre = truth.cam_from_world.begin()->second.Inverse().translation;
  EXPECT_LT((Eigen::Vector3d(x, y, z) - centre).norm(), 1e-12);
}

// The frame that repeats another has its pose, at its own time, and is no image.
TEST(ModelFolder, TrajectoryHasTheFramesThatRepeatOthers) {
  const TempDir dir;
  Reconstruction written = TrueReconstruction(SmallScene());
  const auto last = std::prev(written.cam_from_world.end());
  for (const auto& [frame, pose] : written.cam_from_world) {
    written.timestamps_ns[frame] = 1'000'000'000 * std::int64_t{ToInt(frame)};
  }
  const FrameIndex copy{ToInt(last->first) + 1};
  written.repeats = {{{copy, "", 123'500'000'000}, last->first}};
  WriteReconstruction(dir / "model", written);
  std::istringstream lines(ReadBytes(dir / "model" / "trajectory.tum"));
  std::vector<std::string> all;
  for (std::string line; std::getline(lines, line);) all.push_back(line);
  ASSERT_EQ(all.size(), written.cam_from_world.size() + 1);
  EXPECT_THAT(all.back(), testing::StartsWith("123.500000000 "));
  EXPECT_EQ(all.back().substr(all.back().find(' ')),
            all[all.size() - 2].substr(all[all.size() - 2].find(' ')));
  const Reconstruction read = ReadReconstruction(dir / "model");
  EXPECT_EQ(read.timestamps_ns, written.timestamps_ns);
}

TEST(ModelFolder, PlyHasFifteenBytesAPoint) {
  const TempDir dir;
  const Reconstruction truth = TrueReconstruction(SmallScene());
  WriteReconstruction(dir / "model", truth);
  const std::string ply = ReadBytes(dir / "model" / "points.ply");
  const std::size_t header = ply.find("end_header\n") + 11;
  EXPECT_THAT(ply, HasSubstr("format binary_little_endian 1.0\n"));
  EXPECT_EQ(ply.size(), header + 15 * truth.points.size());
  float xyz[3];
  std::memcpy(xyz, ply.data() + header, sizeof(xyz));
  EXPECT_EQ(xyz[2], static_cast<float>(truth.points.begin()->second.in_world.z()));
}

TEST(ModelFolder, AnEmptyReconstructionIsAModelToo) {
  const TempDir dir;
  Reconstruction empty;
  empty.camera = SyntheticTracksOptions::DefaultCamera();
  WriteReconstruction(dir / "model", empty);
  EXPECT_TRUE(ReadReconstruction(dir / "model").cam_from_world.empty());
}

TEST(ColmapModel, NamesTheLineOrByteThatIsDamaged) {
  const TempDir dir;
  EXPECT_THAT([&] { ReadColmapModel(dir.path()); },
              ThrowsMessage<Error>(HasSubstr("is not a model folder")));
  const ColmapModel model = ToColmapModel(TrueReconstruction(SmallScene()));
  WriteColmapModel(dir.path(), model, ColmapModelFormat::kText);
  WriteBytes(dir / "points3D.txt", "# points\n1 0 0 zero 1 2 3 0.5\n");
  EXPECT_THAT([&] { ReadColmapModel(dir.path()); },
              ThrowsMessage<Error>(HasSubstr("points3D.txt, line 2: \"zero\" is not a number")));
  WriteBytes(dir / "points3D.txt", "1 0 0 0 1 2 3 0.5\n1 5 0 0 1 2 3 0.5\n");
  EXPECT_THAT([&] { ReadColmapModel(dir.path()); },
              ThrowsMessage<Error>(HasSubstr("points3D.txt, line 2: a second point 1")));
  WriteBytes(dir / "points3D.txt", "1 0 0 0 1 2 3 0.5 77 0\n");
  EXPECT_THAT([&] { ReadColmapModel(dir.path()); },
              ThrowsMessage<Error>(HasSubstr("image 77, which does not exist")));
  const std::string camera = "7 PINHOLE 160 120 131 131 80 60\n";
  WriteBytes(dir / "cameras.txt", camera + camera);
  EXPECT_THAT([&] { ReadColmapModel(dir.path()); },
              ThrowsMessage<Error>(HasSubstr("cameras.txt, line 2: a second camera 7")));
  WriteBytes(dir / "cameras.txt", "7 FOV 160 120 131 131 80 60 0\n");
  EXPECT_THAT([&] { ReadColmapModel(dir.path()); },
              ThrowsMessage<Error>(HasSubstr("cameras.txt, line 1: COLMAP camera model FOV")));
  WriteColmapModel(dir.path(), model, ColmapModelFormat::kBinary);
  const std::string bytes = ReadBytes(dir / "images.bin");
  WriteBytes(dir / "images.bin", bytes.substr(0, bytes.size() / 2));
  EXPECT_THAT([&] { ReadColmapModel(dir.path()); },
              ThrowsMessage<Error>(HasSubstr("images.bin is truncated or damaged")));
  const std::string camera_twice = ReadBytes(dir / "cameras.bin");
  WriteBytes(dir / "cameras.bin",
             std::string("\2") + camera_twice.substr(1) + camera_twice.substr(8));
  EXPECT_THAT([&] { ReadColmapModel(dir.path()); },
              ThrowsMessage<Error>(HasSubstr("cameras.bin has a second camera")));
}

TEST(ModelFolder, OfColmapsOwnIsNotReplaced) {
  const TempDir dir;
  const Reconstruction truth = TrueReconstruction(SmallScene());
  std::filesystem::create_directory(dir / "sparse");
  WriteColmapModel(dir / "sparse", ToColmapModel(truth), ColmapModelFormat::kBinary);
  EXPECT_THAT([&] { WriteReconstruction(dir / "sparse", truth); },
              ThrowsMessage<Error>(HasSubstr("were not written by cohort")));
  WriteReconstruction(dir / "model", truth);
  EXPECT_NO_THROW(WriteReconstruction(dir / "model", truth));
}

// As COLMAP does.
TEST(ColmapModel, BlanksAtTheEndsOfALineOfTextAreNoPartOfIt) {
  const TempDir dir;
  WriteBytes(dir / "cameras.txt", "  \t# indented\n\t1 PINHOLE 640 480 500 500 320 240 \t\r\n\t\n");
  WriteBytes(dir / "images.txt",
             "\t# indented\n"
             " 1 1 0 0 0 0 0 1 1 a b.png \t\n\n"         // no points: an empty line,
             "2 1 0 0 0 0 0 1 1 b.png\r\n \t\r\n"        // or one of blanks
             "3 1 0 0 0 0 0 1 1 c.png\t\n\t5 6 7\t\r\n"  //
             "\n");
  WriteBytes(dir / "points3D.txt", " \t\n\t7 0 0 0 1 2 3 0.5 3 0\t\n\t# indented");
  const ColmapModel model = ReadColmapModel(dir.path());
  EXPECT_EQ(model.cameras.at(1).params.size(), 4u);
  ASSERT_EQ(model.images.size(), 3u);
  EXPECT_EQ(model.images.at(1).name, "a b.png");
  EXPECT_TRUE(model.images.at(1).points2d.empty());
  EXPECT_EQ(model.images.at(2).name, "b.png");
  EXPECT_TRUE(model.images.at(2).points2d.empty());
  EXPECT_EQ(model.images.at(3).name, "c.png");
  EXPECT_EQ(model.images.at(3).points2d.at(0).point3d, 7u);
  EXPECT_EQ(model.points.at(7).track.size(), 1u);
}

TEST(ColmapModel, TakesNoNumbersThatAreNone) {
  const TempDir dir;
  const std::string cameras = "1 PINHOLE 640 480 500 500 320 240\n";
  const std::string images = "1 1 0 0 0 0 0 1 1 a.png\n5 6 7\n";
  const std::string points = "7 0 0 0 1 2 3 0.5 1 0\n";
  const auto read = [&](const std::string& c, const std::string& i, const std::string& p) {
    WriteBytes(dir / "cameras.txt", c);
    WriteBytes(dir / "images.txt", i);
    WriteBytes(dir / "points3D.txt", p);
    FromColmapModel(ReadColmapModel(dir.path()));
  };
  EXPECT_NO_THROW(read(cameras, images, points));
  for (const char* camera : {"1 PINHOLE 640 480 500 nan 320 240\n",
                             "1 PINHOLE 640 480 500 500 inf 240\n",
                             "1 PINHOLE 640 480 0 500 320 240\n",
                             "1 PINHOLE 640 480 -1 500 320 240\n",
                             "1 PINHOLE -640 480 500 500 320 240\n",
                             "1 PINHOLE 2000000000 480 500 500 320 240\n"}) {
    EXPECT_THROW(read(camera, images, points), Error) << camera;
  }
  for (const char* image : {"1 0 0 0 0 0 0 1 1 a.png\n5 6 7\n",
                            "1 1 0 nan 0 0 0 1 1 a.png\n5 6 7\n",
                            "1 1 1e200 1e200 0 0 0 1 1 a.png\n5 6 7\n",
                            "1 1 0 0 0 0 inf 1 1 a.png\n5 6 7\n",
                            "1 1 0 0 0 0 0 1 1 a.png\nnan 6 7\n"}) {
    EXPECT_THROW(read(cameras, image, points), Error) << image;
  }
  EXPECT_THROW(read(cameras, images, "7 0 nan 0 1 2 3 0.5 1 0\n"), Error);

  // A side that fits no int, and a count of 2^60, in binary.
  ColmapModel model = ToColmapModel(TrueReconstruction(SmallScene()));
  WriteColmapModel(dir.path(), model, ColmapModelFormat::kBinary);
  std::string bytes = ReadBytes(dir / "cameras.bin");
  bytes[8 + 4 + 4 + 4] = 1;  // the fifth byte of the width
  WriteBytes(dir / "cameras.bin", bytes);
  EXPECT_THROW(FromColmapModel(ReadColmapModel(dir.path())), Error);
  for (const char* file : {"cameras.bin", "images.bin", "points3D.bin"}) {
    WriteColmapModel(dir.path(), model, ColmapModelFormat::kBinary);
    bytes = ReadBytes(dir / file);
    bytes[7] = 0x10;  // the last byte of the count
    WriteBytes(dir / file, bytes);
    EXPECT_THAT([&] { ReadColmapModel(dir.path()); },
                ThrowsMessage<Error>(HasSubstr("truncated or damaged")))
        << file;
  }
}

// They stand in text, a line each, and COLMAP writes pictures by them.
TEST(ColmapModel, TakesNoNameThatLeadsOutOrIsTwoLines) {
  const TempDir dir;
  ColmapModel model = ToColmapModel(TrueReconstruction(SmallScene()));
  for (const char* name : {"../x.png", "/etc/passwd", "a\n9 1 0 0 0 0 0 0 1 b.png", ""}) {
    model.images.begin()->second.name = name;
    WriteColmapModel(dir.path(), model, ColmapModelFormat::kBinary);
    EXPECT_THAT([&] { ReadColmapModel(dir.path()); },
                ThrowsMessage<Error>(HasSubstr("the name of picture '")))
        << name;
  }
}

TEST(ModelFolder, TakesNoTimeThatIsNone) {
  const TempDir dir;
  WriteReconstruction(dir / "model", TrueReconstruction(SmallScene()));
  for (const char* time : {"--5", "-", "1.5.5", "9223372037", "--9223372036.854775808"}) {
    WriteBytes(dir / "model" / "trajectory.tum", std::string(time) + " 0 0 0 0 0 0 1\n");
    EXPECT_THAT([&] { ReadReconstruction(dir / "model"); },
                ThrowsMessage<Error>(HasSubstr("not a time in seconds")))
        << time;
  }
}

}  // namespace
}  // namespace cohort
