#include "datasets/readers/tum_writer.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <opencv2/core.hpp>

#include "datasets/open_sequence.h"
#include "frontend/core/error.h"
#include "tests/datasets/fixtures.h"
#include "tests/support/cameras.h"
#include "tests/support/child_process.h"
#include "tests/support/closed_form_image.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using test::TempDir;
using testing::AllOf;
using testing::HasSubstr;
using testing::StartsWith;

TumWriter::Record Record(int frame) {
  TumWriter::Record record;
  record.timestamp_ns = 1'305'031'102'175'304'123 + 33'333'333 * static_cast<std::int64_t>(frame);
  record.picture = test::WavesImage(64, 48, frame, 0.0);
  return record;
}

TEST(TumWriter, WritesWhatReadTumReads) {
  const TempDir dir;
  Camera camera{.width_px = 64, .height_px = 48, .fx = 61.0 / 3.0, .fy = 20.5, .cx = 31.5};
  camera.cy = 23.25;
  camera.k1 = -0.1;
  camera.p2 = 1e-3;
  const Rigid3 pose{Eigen::Quaterniond(0.5, -0.5, 0.1, 0.7).normalized(), {1.0 / 3.0, -2e-7, 3e5}};
  {
    TumWriter writer(dir / "clip");
    writer.WriteCamera(camera);
    for (const int frame : {2, 0, 1}) {  // in any order
      TumWriter::Record record = Record(frame);
      if (frame != 0) record.cam_from_world = pose;
      if (frame == 1) {
        record.depth_m = cv::Mat(48, 64, CV_32FC1, cv::Scalar(2.5));
        record.depth_m->at<float>(3, 4) = 13.2F;  // 16 bits end at 13.107 m
        record.occluder = cv::Mat(48, 64, CV_8UC1, cv::Scalar(255));
      }
      writer.Write(static_cast<std::size_t>(frame), record);
    }
    EXPECT_FALSE(fs::exists(dir / "clip"));
    writer.Finish();
  }
  const auto sequence = OpenSequence(dir / "clip");
  const auto frames = test::ReadAll(*sequence);
  ASSERT_EQ(frames.size(), 3u);
  for (int i = 0; i < 3; ++i) {
    const Frame& frame = frames[static_cast<std::size_t>(i)];
    EXPECT_EQ(frame.timestamp_ns, Record(i).timestamp_ns);
    EXPECT_EQ(cv::norm(frame.gray, Record(i).picture), 0.0);
  }
  const Camera read = sequence->KnownCamera().value();
  EXPECT_EQ(read.fx, camera.fx);
  EXPECT_EQ(read.cy, camera.cy);
  EXPECT_EQ(read.k1, camera.k1);
  EXPECT_EQ(read.p2, camera.p2);
  EXPECT_EQ(sequence->TrueCamFromWorld().count(FrameIndex{0}), 0u);
  const Rigid3 error = sequence->TrueCamFromWorld().at(FrameIndex{2}) * pose.Inverse();
  EXPECT_LT(error.translation.norm(), 1e-9);
  EXPECT_LT(AngleBetween(error.rotation, Eigen::Quaterniond::Identity()), 1e-12);
  EXPECT_FALSE(sequence->TrueDepth(FrameIndex{0}));
  const cv::Mat depth = sequence->TrueDepth(FrameIndex{1}).value();
  EXPECT_FLOAT_EQ(depth.at<float>(0, 0), 2.5F);
  EXPECT_EQ(depth.at<float>(3, 4), 0.0F);
  EXPECT_EQ(cv::countNonZero(*sequence->OccluderMask(FrameIndex{1})), 64 * 48);
}

TEST(TumWriter, WritesCamerasOfAllModels) {
  for (Camera camera : {test::FreiburgCamera(), test::RationalCamera(), test::FisheyeCamera()}) {
    const TempDir dir;
    TumWriter writer(dir / "clip");
    writer.WriteCamera(camera);
    writer.Write(0, Record(0));
    writer.Finish();
    const Camera read = OpenSequence(dir / "clip")->KnownCamera().value();
    EXPECT_EQ(read.model, camera.model);
    EXPECT_EQ(read.k2, camera.k2);
    EXPECT_EQ(read.p1, camera.p1);
    EXPECT_EQ(read.k3, camera.k3);
    EXPECT_EQ(read.k6, camera.k6);
  }
}

// A limit on the size of files stands in for a disk that is full.
TEST(TumWriter, AFullDiskIsAnErrorAndTheOldFolderStays) {
  const TempDir dir;
  {
    TumWriter writer(dir / "clip");
    writer.Write(0, Record(0));
    writer.Finish();
  }
  const std::string said = test::RunInChild([&] {
    signal(SIGXFSZ, SIG_IGN);
    const rlimit limit{500, 500};
    if (setrlimit(RLIMIT_FSIZE, &limit) != 0) return std::string("no limit");
    TumWriter writer(dir / "clip");
    writer.Write(0, Record(0));
    writer.Finish();
    return std::string("wrote");
  });
  EXPECT_THAT(said,
              AllOf(StartsWith("threw: cannot write"), HasSubstr("clip.partial/rgb/000000.png")));
  EXPECT_EQ(OpenSequence(dir / "clip")->FrameCount(), 1u);
  EXPECT_FALSE(fs::exists(dir / "clip.partial"));
}

TEST(TumWriter, TimesMayBeBeforeZero) {
  const TempDir dir;
  const std::vector<std::int64_t> times{-3'250'000'000, -550'000'000, -1, 0, 7'000'000'001};
  TumWriter writer(dir / "clip");
  for (std::size_t i = 0; i < times.size(); ++i) {
    TumWriter::Record record = Record(0);
    record.timestamp_ns = times[i];
    writer.Write(i, record);
  }
  writer.Finish();
  const auto frames = test::ReadAll(*OpenSequence(dir / "clip"));
  ASSERT_EQ(frames.size(), times.size());
  for (std::size_t i = 0; i < times.size(); ++i) EXPECT_EQ(frames[i].timestamp_ns, times[i]);
}

}  // namespace
}  // namespace cohort
