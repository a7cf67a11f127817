// TUM, EuRoC and KITTI layouts: what is read from which file, and what is said of a bad one.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <opencv2/imgcodecs.hpp>

#include "datasets/open_sequence.h"
#include "frontend/core/error.h"
#include "frontend/storage/input_file.h"
#include "tests/datasets/fixtures.h"
#include "tests/support/shared_data.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using test::Names;
using test::TempDir;
using test::WriteImage;
using test::WriteText;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::MatchesRegex;
using testing::ThrowsMessage;

void ExpectSame(const Rigid3& a, const Rigid3& b, double tolerance) {
  EXPECT_LT(AngleBetween(a.rotation, b.rotation), tolerance);
  EXPECT_LT((a.translation - b.translation).norm(), tolerance);
}

const Rigid3 kWorldFromCam{Eigen::Quaterniond(0.8, 0.1, -0.2, 0.3).normalized(), {1.0, -2.0, 3.0}};

class Tum : public testing::Test {
 protected:
  // Five images at 30 Hz with times as precise as the data set's.
  void SetUp() override {
    std::string list = "# color images\n# timestamp filename\n";
    for (int i = 0; i < 5; ++i) {
      WriteImage(dir_ / fmt::format("rgb/{}.png", i), i);
      list += fmt::format("1305031102.{:06} rgb/{}.png\n", 175304 + 33333 * i, i);
    }
    WriteText(dir_ / "rgb.txt", list);
  }
  std::string PoseLine(const char* time, const Rigid3& world_from_cam = kWorldFromCam) const {
    const Eigen::Quaterniond& q = world_from_cam.rotation;
    const Eigen::Vector3d& t = world_from_cam.translation;
    return fmt::format(
        "{} {} {} {} {} {} {} {}\n", time, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  }
  TempDir dir_;
};

TEST_F(Tum, ReadsImagesAndTimesToTheNanosecond) {
  const auto sequence = OpenSequence(dir_.path());
  EXPECT_EQ(sequence->ImageRoot(), dir_.path());
  const std::vector<Frame> frames = test::ReadAll(*sequence);
  EXPECT_THAT(Names(frames),
              ElementsAre("rgb/0.png", "rgb/1.png", "rgb/2.png", "rgb/3.png", "rgb/4.png"));
  EXPECT_EQ(frames[0].timestamp_ns, 1'305'031'102'175'304'000);
  EXPECT_EQ(frames[4].timestamp_ns, 1'305'031'102'308'636'000);
  EXPECT_EQ(frames[4].gray.at<std::uint8_t>(0, 0), 4);
  EXPECT_FALSE(sequence->KnownCamera().has_value());
  EXPECT_TRUE(sequence->TrueCamFromWorld().empty());
}

TEST_F(Tum, TimesThatRunBackwardsAreSaid) {
  EXPECT_EQ(OpenSequence(dir_.path())->Warning(), "");
  WriteText(dir_ / "rgb.txt", "1.0 rgb/0.png\n1.2 rgb/2.png\n1.1 rgb/1.png\n1.3 rgb/3.png\n");
  const auto sequence = OpenSequence(dir_.path());
  EXPECT_THAT(Names(test::ReadAll(*sequence)),
              ElementsAre("rgb/0.png", "rgb/2.png", "rgb/1.png", "rgb/3.png"));
  EXPECT_THAT(sequence->Warning(), HasSubstr("the time of rgb/1.png is before that of rgb/2.png"));
}

TEST_F(Tum, AWarningDoesNotHideAnother) {
  WriteText(dir_ / "rgb.txt", "1.0 rgb/0.png\n1.2 rgb/2.png\n1.1 rgb/1.png\n1.3 rgb/gone.png\n");
  const auto sequence = OpenSequence(dir_.path());
  for (int round = 0; round < 2; ++round) {
    EXPECT_EQ(test::ReadAll(*sequence).size(), 3u);
    EXPECT_THAT(
        sequence->Warning(),
        MatchesRegex(".*time of rgb/1.png is before.*listed order; read 3 frames of 4: [^;]*"));
    sequence->Rewind();
  }
}

TEST_F(Tum, ReadsCalibrationWithAndWithoutDistortion) {
  WriteText(dir_ / "calibration.txt", "535 536 320.5 240.25");
  auto camera = OpenSequence(dir_.path())->KnownCamera();
  ASSERT_TRUE(camera.has_value());
  EXPECT_EQ(camera->width_px, test::kWidth);
  EXPECT_EQ(camera->height_px, test::kHeight);
  EXPECT_EQ(camera->fx, 535.0);
  EXPECT_EQ(camera->fy, 536.0);
  EXPECT_EQ(camera->cx, 320.5);
  EXPECT_EQ(camera->cy, 240.25);
  EXPECT_FALSE(camera->HasDistortion());
  EXPECT_TRUE(camera->known);

  WriteText(dir_ / "calibration.txt", "535 536 320.5 240.25 0.1 -0.2 0.003 -0.004\r\n");
  camera = OpenSequence(dir_.path())->KnownCamera();
  EXPECT_EQ(camera->k1, 0.1);
  EXPECT_EQ(camera->k2, -0.2);
  EXPECT_EQ(camera->p1, 0.003);
  EXPECT_EQ(camera->p2, -0.004);

  WriteText(dir_ / "calibration.txt", "517.3 516.5 318.6 255.3 0.2624 -0.9531 -0.0054 0.0026 1.16");
  camera = OpenSequence(dir_.path())->KnownCamera();
  EXPECT_EQ(camera->p2, 0.0026);
  EXPECT_EQ(camera->k3, 1.16);
  WriteText(dir_ / "calibration.txt", "300 301 320 240 fisheye 0.1 0.2 0.3 0.4");
  camera = OpenSequence(dir_.path())->KnownCamera();
  EXPECT_EQ(camera->model, CameraModel::kFisheye);
  EXPECT_EQ(camera->width_px, test::kWidth);
  EXPECT_EQ(camera->k4, 0.4);

  for (const char* text : {"",
                           "535 320 240",
                           "535 535 320 240 0.1 0.2 0.3",
                           "535 535 320 240 fisheye 0.1",
                           "a b c d",
                           "0 535 320 240",
                           "535 nan 320 240"}) {
    WriteText(dir_ / "calibration.txt", text);
    EXPECT_THAT([&] { OpenSequence(dir_.path()); },
                ThrowsMessage<Error>(HasSubstr("calibration.txt")));
  }
}

TEST_F(Tum, PosesGoToTheNearestTimeWithin20Milliseconds) {
  Rigid3 other = kWorldFromCam;
  other.translation.x() = 9.0;
  WriteText(dir_ / "groundtruth.txt",
            "# timestamp tx ty tz qx qy qz qw\n" +
                PoseLine("1305031102.155303", other) +  // 20.001 ms before frame 0
                PoseLine("1305031102.205000", other) +  // 3.6 ms before frame 1: not the nearest
                PoseLine("1305031102.209000") +         // 0.4 ms behind frame 1
                PoseLine("1305031102.261970") +         // 20 ms behind frame 2 exactly
                PoseLine("1305031102.328637"));         // 20.001 ms behind frame 4
  const auto sequence = OpenSequence(dir_.path());
  const auto& poses = sequence->TrueCamFromWorld();
  ASSERT_EQ(poses.size(), 3u);
  ExpectSame(poses.at(FrameIndex{1}), kWorldFromCam.Inverse(), 1e-12);
  ExpectSame(poses.at(FrameIndex{2}), kWorldFromCam.Inverse(), 1e-12);
  ExpectSame(poses.at(FrameIndex{3}), kWorldFromCam.Inverse(), 1e-12);
}

TEST_F(Tum, NamesTheLineOfABadPose) {
  for (const char* line : {"1305031102.2 1 2 3 0 0 0 0\n",
                           "1305031102.2 1 2 3 0 0 0\n",
                           "1305031102.2 1 2 nan 0 0 0 1\n",
                           "1305031102.2 1 2 3 0 1e200 1e200 1\n",
                           "1305031102.2 1 2 x 0 0 0 1\n"}) {
    WriteText(dir_ / "groundtruth.txt", PoseLine("1305031102.1") + line);
    EXPECT_THAT([&] { OpenSequence(dir_.path()); },
                ThrowsMessage<Error>(HasSubstr("groundtruth.txt line 2")));
  }
}

// Further apart than 64 bits of nanoseconds.
TEST_F(Tum, TimesMayBeAnyThatAreRead) {
  WriteText(dir_ / "rgb.txt", "-9e9 rgb/0.png\n9e9 rgb/1.png\n");
  WriteText(dir_ / "groundtruth.txt", PoseLine("9e9"));
  const auto sequence = OpenSequence(dir_.path());
  ASSERT_EQ(sequence->TrueCamFromWorld().size(), 1u);
  EXPECT_TRUE(sequence->TrueCamFromWorld().contains(FrameIndex{1}));
}

TEST_F(Tum, ReadsDepthInMetresAndOccluderMasks) {
  fs::create_directories(dir_ / "depth");
  cv::Mat depth(test::kHeight, test::kWidth, CV_16UC1, cv::Scalar(7500));
  depth.at<std::uint16_t>(1, 2) = 0;
  cv::imwrite((dir_ / "depth/a.png").string(), depth);
  WriteText(dir_ / "depth.txt", "1305031102.180000 depth/a.png\n1305031103.0 depth/missing.png\n");
  cv::Mat mask(test::kHeight, test::kWidth, CV_8UC1, cv::Scalar(0));
  mask.at<std::uint8_t>(3, 4) = 1;
  fs::create_directories(dir_ / "occluder");
  cv::imwrite((dir_ / "occluder/4.png").string(), mask);
  WriteText(dir_ / "occluder.txt", "1305031102.308636 occluder/4.png\n");

  const auto sequence = OpenSequence(dir_.path());
  const auto metres = sequence->TrueDepth(FrameIndex{0});
  ASSERT_TRUE(metres.has_value());
  EXPECT_EQ(metres->type(), CV_32FC1);
  EXPECT_EQ(metres->at<float>(5, 5), 1.5F);
  EXPECT_EQ(metres->at<float>(1, 2), 0.0F);
  EXPECT_FALSE(sequence->TrueDepth(FrameIndex{1}).has_value());

  const auto occluder = sequence->OccluderMask(FrameIndex{4});
  ASSERT_TRUE(occluder.has_value());
  EXPECT_EQ(occluder->type(), CV_8UC1);
  EXPECT_EQ(occluder->at<std::uint8_t>(3, 4), 255);
  EXPECT_EQ(occluder->at<std::uint8_t>(4, 3), 0);
  EXPECT_FALSE(sequence->OccluderMask(FrameIndex{3}).has_value());
}

TEST_F(Tum, DepthOfAnotherKindOrSizeIsAnError) {
  WriteImage(dir_ / "depth8.png", 7);
  cv::imwrite((dir_ / "depth_small.png").string(), cv::Mat(24, 32, CV_16UC1, cv::Scalar(7500)));
  WriteText(dir_ / "depth.txt",
            "1305031102.175304 depth8.png\n1305031102.208637 depth_small.png\n"
            "1305031102.241970 missing.png\n");
  const auto sequence = OpenSequence(dir_.path());
  EXPECT_THAT([&] { sequence->TrueDepth(FrameIndex{0}); },
              ThrowsMessage<Error>(AllOf(HasSubstr("depth8.png"), HasSubstr("16-bit"))));
  EXPECT_THAT([&] { sequence->TrueDepth(FrameIndex{1}); },
              ThrowsMessage<Error>(AllOf(HasSubstr("32x24"), HasSubstr("64x48"))));
  EXPECT_THAT([&] { sequence->TrueDepth(FrameIndex{2}); },
              ThrowsMessage<Error>(HasSubstr("missing.png")));
}

TEST_F(Tum, AListWithoutImagesOrTimesIsAnError) {
  WriteText(dir_ / "rgb.txt", "# nothing\n");
  EXPECT_THAT([&] { OpenSequence(dir_.path()); }, ThrowsMessage<Error>(HasSubstr("no images")));
  WriteText(dir_ / "rgb.txt", "rgb/0.png\n");
  EXPECT_THAT([&] { OpenSequence(dir_.path()); },
              ThrowsMessage<Error>(HasSubstr("rgb.txt line 1")));
  WriteText(dir_ / "rgb.txt", "1305031102175304000 rgb/0.png\n");
  EXPECT_THAT([&] { OpenSequence(dir_.path()); },
              ThrowsMessage<Error>(HasSubstr("rgb.txt line 1")));
}

// Other programs write pictures by these names, into folders of theirs.
TEST_F(Tum, PicturesLieInTheFolder) {
  for (const std::string name : {"../outside.png", "rgb/../../outside.png", "/etc/passwd"}) {
    WriteText(dir_ / "rgb.txt", "1 rgb/0.png\n2 " + name + "\n");
    EXPECT_THAT([&] { OpenSequence(dir_.path()); },
                ThrowsMessage<Error>(AllOf(HasSubstr("'" + name + "'"), HasSubstr("folder"))));
  }
}

TEST_F(Tum, SoDoDepthAndOccluders) {
  for (const std::string list : {"depth.txt", "occluder.txt"}) {
    for (const std::string name : {"../outside.png", "depth/../../outside.png", "/etc/passwd"}) {
      WriteText(dir_ / list, "1 depth/0.png\n2 " + name + "\n");
      EXPECT_THAT([&] { OpenSequence(dir_.path()); },
                  ThrowsMessage<Error>(
                      AllOf(HasSubstr(list), HasSubstr("'" + name + "'"), HasSubstr("folder"))));
    }
    fs::remove(dir_ / list);
  }
}

TEST_F(Tum, APipeOrADeviceIsNotWaitedFor) {
  for (const char* name : {"rgb.txt", "groundtruth.txt", "calibration.txt", "depth.txt"}) {
    fs::rename(dir_ / "rgb.txt", dir_ / "kept");
    WriteText(dir_ / "rgb.txt", ReadBytes(dir_ / "kept"));
    fs::remove(dir_ / name);
    ASSERT_EQ(mkfifo((dir_ / name).c_str(), 0600), 0);
    EXPECT_THAT([&] { OpenSequence(dir_.path()); },
                ThrowsMessage<Error>(AllOf(HasSubstr(name), HasSubstr("a pipe"))))
        << name;
    fs::remove(dir_ / name);
    fs::rename(dir_ / "kept", dir_ / "rgb.txt");
  }
  fs::create_symlink("/dev/zero", dir_ / "groundtruth.txt");
  EXPECT_THAT([&] { OpenSequence(dir_.path()); },
              ThrowsMessage<Error>(AllOf(HasSubstr("groundtruth.txt"), HasSubstr("a device"))));
  fs::remove(dir_ / "rgb/3.png");
  ASSERT_EQ(mkfifo((dir_ / "rgb/3.png").c_str(), 0600), 0);
  fs::remove(dir_ / "groundtruth.txt");
  const auto sequence = OpenSequence(dir_.path());
  EXPECT_EQ(test::ReadAll(*sequence).size(), 3u);
  EXPECT_THAT(sequence->Warning(), HasSubstr("3.png"));
}

TEST_F(Tum, ATableWithoutEndIsAnError) {
  WriteText(dir_ / "groundtruth.txt", std::string(100'000, '1'));
  EXPECT_THAT([&] { OpenSequence(dir_.path()); },
              ThrowsMessage<Error>(HasSubstr("line 1: longer than 65535")));
  std::string lines;
  for (int i = 0; i < 100; ++i) lines += "# " + std::string(1000, 'x') + "\n";
  WriteText(dir_ / "groundtruth.txt", lines);
  fs::resize_file(dir_ / "groundtruth.txt", std::uintmax_t{1} << 40);
  EXPECT_THAT([&] { OpenSequence(dir_.path()); },
              ThrowsMessage<Error>(HasSubstr("tables of up to 268435456 bytes")));
}

class Euroc : public testing::Test {
 protected:
  // Two images; lines end as in the data set's files.
  void SetUp() override {
    WriteImage(mav_ / "cam0/data/1403636579763555584.png", 1);
    WriteImage(mav_ / "cam0/data/1403636579813555456.png", 2);
    WriteText(mav_ / "cam0/data.csv",
              "#timestamp [ns],filename\r\n"
              "1403636579763555584,1403636579763555584.png\r\n"
              "1403636579813555456,1403636579813555456.png\r\n");
    WriteText(mav_ / "cam0/sensor.yaml", kSensor);
  }
  // As the data set's own, for a picture of 64x48.
  static constexpr char kSensor[] = R"(# General sensor definitions.
sensor_type: camera
comment: VI-Sensor cam0 (MT9M034)

# Sensor extrinsics wrt. the body-frame.
T_BS:
  cols: 4
  rows: 4
  data: [0.0148655429818, -0.999880929698, 0.00414029679422, -0.0216401454975,
         0.999557249008, 0.0149672133247, 0.025715529948, -0.064676986768,
        -0.0257744366974, 0.00375618835797, 0.999660727178, 0.00981073058949,
         0.0, 0.0, 0.0, 1.0]

# Camera specific definitions.
rate_hz: 20
resolution: [64, 48]
camera_model: pinhole
intrinsics: [458.654, 457.296, 367.215, 248.375] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05]

)";
  TempDir dir_;
  fs::path mav_ = dir_ / "MH_01_easy/mav0";
};

TEST_F(Euroc, ReadsImagesTimesAndCalibration) {
  for (const fs::path& folder : {mav_.parent_path(), mav_}) {
    const auto sequence = OpenSequence(folder);
    EXPECT_EQ(sequence->Name(), "MH_01_easy");
    EXPECT_EQ(sequence->ImageRoot(), mav_ / "cam0/data");
    const std::vector<Frame> frames = test::ReadAll(*sequence);
    EXPECT_THAT(Names(frames), ElementsAre("1403636579763555584.png", "1403636579813555456.png"));
    EXPECT_EQ(frames[1].timestamp_ns, 1'403'636'579'813'555'456);
    const auto camera = sequence->KnownCamera();
    ASSERT_TRUE(camera.has_value());
    EXPECT_EQ(camera->width_px, 64);
    EXPECT_EQ(camera->fx, 458.654);
    EXPECT_EQ(camera->fy, 457.296);
    EXPECT_EQ(camera->cx, 367.215);
    EXPECT_EQ(camera->cy, 248.375);
    EXPECT_EQ(camera->k1, -0.28340811);
    EXPECT_EQ(camera->k2, 0.07395907);
    EXPECT_EQ(camera->p1, 0.00019359);
    EXPECT_EQ(camera->p2, 1.76187114e-05);
    EXPECT_TRUE(sequence->TrueCamFromWorld().empty());
  }
}

TEST_F(Euroc, ReadsAnEquidistantLensAsFisheye) {
  std::string sensor = kSensor;
  const std::string radtan = "radial-tangential";
  sensor.replace(sensor.find(radtan), radtan.size(), "equidistant");
  WriteText(mav_ / "cam0/sensor.yaml", sensor);
  const auto camera = OpenSequence(mav_.parent_path())->KnownCamera();
  ASSERT_TRUE(camera.has_value());
  EXPECT_EQ(camera->model, CameraModel::kFisheye);
  EXPECT_EQ(camera->width_px, 64);
  EXPECT_EQ(camera->k1, -0.28340811);
  EXPECT_EQ(camera->k2, 0.07395907);
  EXPECT_EQ(camera->p1, 0.0);
  EXPECT_EQ(camera->k3, 0.00019359);
  EXPECT_EQ(camera->k4, 1.76187114e-05);
}

TEST_F(Euroc, CamerasStandWhereTheBodyCarriesThem) {
  // The first row is 2 ms before image 0; image 1 has none within 20 ms.
  const Eigen::Quaterniond& q = kWorldFromCam.rotation;
  WriteText(mav_ / "state_groundtruth_estimate0/data.csv",
            "#timestamp, p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], ...\r\n" +
                fmt::format("1403636579761555584,1.0,-2.0,3.0,{},{},{},{},0.1,0.2\r\n"
                            "1403636579840000000,0,0,0,1,0,0,0,0.1,0.2\r\n",
                            q.w(),
                            q.x(),
                            q.y(),
                            q.z()));
  const auto sequence = OpenSequence(mav_.parent_path());
  const auto& poses = sequence->TrueCamFromWorld();
  ASSERT_EQ(poses.size(), 1u);

  // By hand: the camera's centre and its axis z in the world.
  const Eigen::Matrix3d world_from_body = q.toRotationMatrix();
  const Eigen::Vector3d centre =
      world_from_body * Eigen::Vector3d(-0.0216401454975, -0.064676986768, 0.00981073058949) +
      Eigen::Vector3d(1.0, -2.0, 3.0);
  const Eigen::Vector3d axis =
      world_from_body * Eigen::Vector3d(0.00414029679422, 0.025715529948, 0.999660727178);
  const Rigid3 world_from_cam = poses.at(FrameIndex{0}).Inverse();
  EXPECT_LT((world_from_cam.translation - centre).norm(), 1e-9);
  EXPECT_LT((world_from_cam.rotation * Eigen::Vector3d::UnitZ() - axis).norm(), 1e-9);
}

TEST_F(Euroc, WithoutSensorFileThereIsNeitherCalibrationNorTruth) {
  fs::remove(mav_ / "cam0/sensor.yaml");
  WriteText(mav_ / "state_groundtruth_estimate0/data.csv", "1403636579763555584,0,0,0,1,0,0,0\n");
  const auto sequence = OpenSequence(mav_.parent_path());
  EXPECT_FALSE(sequence->KnownCamera().has_value());
  EXPECT_TRUE(sequence->TrueCamFromWorld().empty());
}

TEST_F(Euroc, SaysWhatIsWrongWithTheSensorFile) {
  const auto with = [&](const std::string& old, const std::string& text) {
    std::string sensor = kSensor;
    sensor.replace(sensor.find(old), old.size(), text);
    WriteText(mav_ / "cam0/sensor.yaml", sensor);
    return [this] { OpenSequence(mav_.parent_path()); };
  };
  EXPECT_THAT(with("radial-tangential", "fov"),
              ThrowsMessage<Error>(AllOf(HasSubstr("sensor.yaml"), HasSubstr("'fov'"))));
  EXPECT_THAT(with(", 1.76187114e-05", ""),
              ThrowsMessage<Error>(
                  AllOf(HasSubstr("sensor.yaml"), HasSubstr("3 distortion coefficients"))));
  EXPECT_THAT(with("intrinsics:", "intrinsic:"), ThrowsMessage<Error>(HasSubstr("intrinsics")));
  EXPECT_THAT(with("458.654, ", ""), ThrowsMessage<Error>(HasSubstr("intrinsics")));
  EXPECT_THAT(with("458.654", "f"), ThrowsMessage<Error>(HasSubstr("intrinsics")));
  EXPECT_THAT(with("0.999557249008", "0.5"), ThrowsMessage<Error>(HasSubstr("T_BS")));
  EXPECT_THAT(with("data: [", "data: [["), ThrowsMessage<Error>(HasSubstr("sensor.yaml")));
  EXPECT_THAT(with("cols: 4", ": radial"), ThrowsMessage<Error>(HasSubstr("sensor.yaml")));
  EXPECT_THAT(with("cols: 4", "data: [1]"),
              ThrowsMessage<Error>(AllOf(HasSubstr("T_BS.data"), HasSubstr("twice"))));
  EXPECT_THAT(with("intrinsics:", std::string(65, 'i') + ":"),
              ThrowsMessage<Error>(HasSubstr("is not `key: value`")));
  EXPECT_THAT(with("[64, 48]", "[64, 48"), ThrowsMessage<Error>(HasSubstr("resolution")));
  EXPECT_THAT(with("[64, 48]", "64"), ThrowsMessage<Error>(HasSubstr("not a list")));
  EXPECT_THAT(with("458.654", "-458.654"), ThrowsMessage<Error>(HasSubstr("focal lengths")));
  EXPECT_THAT(with("458.654", ".nan"), ThrowsMessage<Error>(HasSubstr("sensor.yaml")));
  EXPECT_THAT(with("[64, 48]", "[1e300, 48]"), ThrowsMessage<Error>(HasSubstr("resolution")));
  EXPECT_THAT(with("[64, 48]", "[-64, 48]"), ThrowsMessage<Error>(HasSubstr("resolution")));
  EXPECT_THAT(with("[64, 48]", "[752, 480]"),
              ThrowsMessage<Error>(AllOf(HasSubstr("752x480"), HasSubstr("64x48"))));
}

TEST_F(Euroc, AnEndlesslyNestedSensorFileIsAnError) {
  for (const char* open : {"[", "{", "- ", "-", "b: "}) {
    std::string text = "a: ";
    for (int i = 0; i < 20'000; ++i) text += open;
    WriteText(mav_ / "cam0/sensor.yaml", text + "\n");
    EXPECT_THAT([&] { OpenSequence(mav_.parent_path()); },
                ThrowsMessage<Error>(HasSubstr("sensor.yaml")))
        << open;
  }
  WriteText(mav_ / "cam0/sensor.yaml", "# " + std::string(2000, '-') + "\n" + kSensor);
  EXPECT_TRUE(OpenSequence(mav_.parent_path())->KnownCamera().has_value());
  WriteText(mav_ / "cam0/sensor.yaml", std::string(100'000, ' '));
  EXPECT_THAT([&] { OpenSequence(mav_.parent_path()); },
              ThrowsMessage<Error>(HasSubstr("65536 bytes")));
}

class Kitti : public testing::Test {
 protected:
  void WriteImages(const std::string& folder) {
    for (int i = 0; i < 3; ++i) WriteImage(sequence_ / folder / fmt::format("{:06}.png", i), i);
  }
  // K = 700, 710, 600, 180; camera 2 is 0.5 m beside camera 0: fourth column K (0.5, 0, 0).
  static constexpr char kP0[] = "700 0 600 0 0 710 180 0 0 0 1 0";
  static constexpr char kP2[] = "700 0 600 350 0 710 180 0 0 0 1 0";
  // world_from_cam: one step ahead per image, turned by 90 degrees about y from the second on.
  static constexpr char kPoses[] =
      "1 0 0 0 0 1 0 0 0 0 1 0\n0 0 1 1 0 1 0 0 -1 0 0 2\n0 0 1 2 0 1 0 0 -1 0 0 2\n";
  TempDir dir_;
  fs::path sequence_ = dir_ / "sequences/07";
};

TEST_F(Kitti, ReadsGreyImagesCalibrationTimesAndPoses) {
  for (const char* folder : {"image_l", "image_0"}) {
    for (const std::string names : {"P0: ", ""}) {
      WriteImages(folder);
      WriteText(sequence_ / "calib.txt",
                names + kP0 + "\n" + (names.empty() ? "" : "P1: ") + "1 0 0 0 0 1 0 0 0 0 1 0");
      WriteText(sequence_ / "poses.txt", kPoses);
      WriteText(sequence_ / "times.txt", "0.000000e+00\n1.036224e-01\n2.072e-01\n3.1e-01\n");
      const auto sequence = OpenSequence(sequence_);
      EXPECT_EQ(sequence->Name(), "07");
      EXPECT_EQ(sequence->ImageRoot(), sequence_ / folder);
      const std::vector<Frame> frames = test::ReadAll(*sequence);
      EXPECT_THAT(Names(frames), ElementsAre("000000.png", "000001.png", "000002.png"));
      EXPECT_EQ(frames[1].timestamp_ns, 103'622'400);
      const auto camera = sequence->KnownCamera();
      ASSERT_TRUE(camera.has_value());
      EXPECT_EQ(camera->fx, 700.0);
      EXPECT_EQ(camera->fy, 710.0);
      EXPECT_EQ(camera->cx, 600.0);
      EXPECT_EQ(camera->cy, 180.0);
      EXPECT_EQ(camera->width_px, test::kWidth);
      const auto& poses = sequence->TrueCamFromWorld();
      ASSERT_EQ(poses.size(), 3u);
      // The camera at (1, 0, 2) looks along the world's x.
      const Eigen::Vector3d ahead = poses.at(FrameIndex{1}) * Eigen::Vector3d(11.0, 0.0, 2.0);
      EXPECT_LT((ahead - Eigen::Vector3d(0.0, 0.0, 10.0)).norm(), 1e-12);
    }
  }
}

// Finite in the file, but not where its camera stands.
TEST_F(Kitti, NumbersThatOverflowAreAnError) {
  WriteImages("image_0");
  WriteText(sequence_ / "calib.txt", "P0: 1e-300 0 48 1e300 0 1e-300 36 1e300 0 0 1 1e300");
  WriteText(sequence_ / "poses.txt", kPoses);
  EXPECT_THAT([&] { OpenSequence(sequence_); },
              ThrowsMessage<Error>(HasSubstr("pose of frame 0 is not finite")));
  WriteText(sequence_ / "calib.txt", "P0: 1e300 0 48 0 0 1e300 36 0 0 0 1 0");
  EXPECT_THAT([&] { OpenSequence(sequence_); },
              ThrowsMessage<Error>(HasSubstr("more than any camera has")));
}

TEST_F(Kitti, ReadsColourImagesFromTheirOwnCamera) {
  WriteImages("image_2");
  WriteText(sequence_ / "calib.txt",
            std::string("P0: ") + kP0 + "\nP1: " + kP0 + "\nP2: " + kP2 + "\nTr: " + kP0 + "\n");
  WriteText(dir_ / "poses/07.txt", kPoses);  // where the data set has them
  const auto sequence = OpenSequence(sequence_);
  const auto& poses = sequence->TrueCamFromWorld();
  ASSERT_EQ(poses.size(), 3u);
  EXPECT_LT((poses.at(FrameIndex{0}).translation - Eigen::Vector3d(0.5, 0.0, 0.0)).norm(), 1e-12);
  // Camera 2 stands at (-0.5, 0, 0) of camera 0, whose x is -z of the world.
  const Rigid3 world_from_cam = poses.at(FrameIndex{1}).Inverse();
  EXPECT_LT((world_from_cam.translation - Eigen::Vector3d(1.0, 0.0, 2.5)).norm(), 1e-12);
  EXPECT_EQ(test::ReadAll(*sequence)[2].timestamp_ns, 200'000'000);
}

TEST_F(Kitti, SaysWhatIsWrong) {
  const auto open = [this] { OpenSequence(sequence_); };
  fs::create_directories(sequence_ / "image_0");
  EXPECT_THAT(open, ThrowsMessage<Error>(HasSubstr("no images")));
  WriteImages("image_0");
  WriteText(sequence_ / "times.txt", "0\n");
  EXPECT_THAT(open, ThrowsMessage<Error>(AllOf(HasSubstr("times.txt"), HasSubstr("3 images"))));
  fs::remove(sequence_ / "times.txt");
  WriteText(sequence_ / "calib.txt", "P1: 1 0 0 0 0 1 0 0 0 0 1 0\n");
  EXPECT_THAT(open, ThrowsMessage<Error>(AllOf(HasSubstr("calib.txt"), HasSubstr("camera 0"))));
  WriteText(sequence_ / "calib.txt", "P0: 1 0 0 0 0 1 0 0 0 0 1\n");
  EXPECT_THAT(open, ThrowsMessage<Error>(HasSubstr("calib.txt line 1")));
  fs::remove(sequence_ / "calib.txt");
  WriteText(sequence_ / "poses.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 2 0\n");
  EXPECT_THAT(open, ThrowsMessage<Error>(HasSubstr("poses.txt line 2")));
}

TEST_F(Kitti, RowsOfMissingImagesAreNoOthers) {
  WriteImages("image_0");
  fs::remove(sequence_ / "image_0/000001.png");
  const auto open = [this] { OpenSequence(sequence_); };
  const auto is_said = ThrowsMessage<Error>(
      HasSubstr("3 rows, but there are 2 images, of which number 1 is 000002.png"));
  WriteText(sequence_ / "times.txt", "0\n0.1\n0.2\n");
  EXPECT_THAT(open, is_said);
  WriteText(sequence_ / "times.txt", "0\n0.2\n");
  WriteText(sequence_ / "poses.txt", kPoses);
  EXPECT_THAT(open, is_said);
  fs::remove(sequence_ / "poses.txt");
  EXPECT_EQ(test::ReadAll(*OpenSequence(sequence_))[1].timestamp_ns, 200'000'000);
}

TEST(SharedSequences, OpensTheKitchenInTumLayout) {
  const fs::path folder = test::SharedData("7scenes_redkitchen_000_299");
  COHORT_SKIP_WITHOUT(folder);
  const auto sequence = OpenSequence(folder, Layout::kAuto, FrameRange::Parse("290:"));
  EXPECT_EQ(sequence->KnownCamera()->fx, 535.0);
  EXPECT_EQ(sequence->TrueCamFromWorld().size(), 300u);
  EXPECT_EQ(test::ReadAll(*sequence).size(), 10u);
  // By eye: the file's first pose.
  const Rigid3 world_from_cam = sequence->TrueCamFromWorld().at(FrameIndex{0}).Inverse();
  EXPECT_NEAR(world_from_cam.translation.x(), -0.3404563, 1e-12);
}

TEST(SharedSequences, OpensTheStreetInKittiLayout) {
  const fs::path folder = test::SharedData("kitti_odo_seq1");
  COHORT_SKIP_WITHOUT(folder);
  const auto sequence = OpenSequence(folder);
  EXPECT_EQ(sequence->FrameCount(), 51u);
  EXPECT_EQ(sequence->KnownCamera()->fx, 707.0912);
  EXPECT_EQ(sequence->KnownCamera()->width_px, 1226);
  EXPECT_EQ(sequence->TrueCamFromWorld().size(), 51u);
  EXPECT_EQ(test::ReadAll(*sequence).size(), 51u);
  // The car drives forward: 1.2 m along z in the first step.
  EXPECT_NEAR(
      sequence->TrueCamFromWorld().at(FrameIndex{1}).Inverse().translation.z(), 1.199, 1e-3);
}

TEST(SharedSequences, OpensImageFoldersInNaturalOrder) {
  const fs::path folder = test::SharedData("cmu_hotel/frames");
  COHORT_SKIP_WITHOUT(folder);
  const std::vector<Frame> frames = test::ReadAll(*OpenSequence(folder));
  ASSERT_EQ(frames.size(), 101u);
  EXPECT_EQ(frames[10].name, "hotel.seq10.png");
}

}  // namespace
}  // namespace cohort
