// The degradations: what the recipes promise of mean, noise and blur, and what is written.
#include "datasets/degrade/degrade.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <opencv2/imgproc.hpp>

#include "datasets/open_sequence.h"
#include "datasets/readers/tum_writer.h"
#include "frontend/core/child_process.h"
#include "frontend/core/error.h"
#include "frontend/storage/output.h"
#include "tests/datasets/fixtures.h"
#include "tests/datasets/render/displacement.h"
#include "tests/support/closed_form_image.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using test::TempDir;
using test::WriteImage;
using testing::HasSubstr;
using testing::ThrowsMessage;

DegradeOptions Options(DegradeRecipe recipe, double level) {
  DegradeOptions options;
  options.recipe = recipe;
  options.level = level;
  return options;
}

struct Statistics {
  double mean, sigma;  // intensities 0..1
};
Statistics MeanAndSpread(const cv::Mat& picture) {
  cv::Scalar mean;
  cv::Scalar sigma;
  cv::meanStdDev(picture, mean, sigma);
  return {mean[0] / 255.0, sigma[0] / 255.0};
}

TEST(Levels, AreTheTablesAndBetween) {
  EXPECT_EQ(PaperLevelAt(0).gain, 1.0);
  EXPECT_EQ(PaperLevelAt(0).noise_before, 0.004);
  EXPECT_EQ(PaperLevelAt(0).blur_px, 0.0);
  EXPECT_EQ(PaperLevelAt(0).noise_after, 0.0);
  EXPECT_NEAR(PaperLevelAt(1).gain, 0.3, 1e-12);
  EXPECT_NEAR(PaperLevelAt(1).noise_before, 0.04, 1e-12);
  EXPECT_EQ(PaperLevelAt(1).blur_px, 2.0);
  EXPECT_NEAR(PaperLevelAt(1).noise_after, 0.02, 1e-12);
  EXPECT_NEAR(PaperLevelAt(2).gain, 0.2, 1e-12);
  EXPECT_NEAR(PaperLevelAt(2).noise_before, 0.06, 1e-12);
  EXPECT_EQ(PaperLevelAt(2).blur_px, 2.0);
  EXPECT_NEAR(PaperLevelAt(2).noise_after, 0.03, 1e-12);
  EXPECT_NEAR(PaperLevelAt(1.5).noise_before, 0.05, 1e-12);
  EXPECT_NEAR(PaperLevelAt(1.5).gain, std::sqrt(0.06), 1e-12);
  EXPECT_NEAR(PaperLevelAt(0.5).blur_px, 1.0, 1e-12);
  EXPECT_NEAR(PaperLevelAt(3).noise_after, 0.04, 1e-12);

  for (const auto& [level, gain, shot] :
       {std::tuple{0.0, 1.0, 1e-4}, std::tuple{1.0, 0.08, 0.006}, std::tuple{2.0, 0.04, 0.012}}) {
    const SensorLevel sensor = SensorLevelAt(level);
    EXPECT_NEAR(sensor.gain, gain, 1e-12);
    EXPECT_NEAR(sensor.shot, shot, 1e-12);
    EXPECT_NEAR(std::log(sensor.read), 2.18 * std::log(shot) + 1.2, 1e-9);
  }
  // Darker and noisier all the way, far beyond hard too.
  for (double level = 0.0; level < 10.0; level += 0.25) {
    EXPECT_LT(PaperLevelAt(level + 0.25).gain, PaperLevelAt(level).gain);
    EXPECT_GT(PaperLevelAt(level + 0.25).noise_before, PaperLevelAt(level).noise_before);
    EXPECT_GT(PaperLevelAt(level + 0.25).gain, 0.0);
    EXPECT_LT(SensorLevelAt(level + 0.25).gain, SensorLevelAt(level).gain);
    EXPECT_GT(SensorLevelAt(level + 0.25).shot, SensorLevelAt(level).shot);
    EXPECT_LE(SensorLevelAt(level + 0.25).shutter, 1.0);
  }
}

TEST(Levels, AreNamedOrNumbers) {
  EXPECT_EQ(ParseLevel("clean"), 0.0);
  EXPECT_EQ(ParseLevel("medium"), 1.0);
  EXPECT_EQ(ParseLevel("hard"), 2.0);
  EXPECT_EQ(ParseLevel("1.25"), 1.25);
  for (const char* text : {"", "dark", "-1", "11", "1x", "nan"}) {
    EXPECT_THAT([&] { ParseLevel(text); },
                ThrowsMessage<UsageError>(HasSubstr(fmt::format("'{}'", text))));
  }
}

// Noise before the blur is averaged by it: s1 / (2 sqrt(pi) blur).
TEST(PaperRecipe, HasTheMeanAndTheNoiseThatItPromises) {
  const cv::Mat flat(400, 400, CV_8UC1, cv::Scalar(204));  // 0.8
  for (const double level : {1.0, 1.5, 2.0}) {
    const PaperLevel paper = PaperLevelAt(level);
    const Statistics statistics =
        MeanAndSpread(DegradeFrame(flat, Options(DegradeRecipe::kPaper, level), 0));
    EXPECT_NEAR(statistics.mean, 0.8 * paper.gain, 0.002) << level;
    const double blurred = paper.noise_before / (2.0 * std::sqrt(M_PI) * paper.blur_px);
    EXPECT_NEAR(statistics.sigma / std::hypot(blurred, paper.noise_after, 1 / std::sqrt(12) / 255),
                1.0,
                0.03)
        << level;
  }
  const Statistics clean =
      MeanAndSpread(DegradeFrame(flat, Options(DegradeRecipe::kPaper, 0.0), 0));
  EXPECT_NEAR(clean.mean, 0.8, 1e-3);
  EXPECT_NEAR(clean.sigma, std::hypot(0.004, 1 / std::sqrt(12) / 255), 2e-4);
}

// Back in linear light, before gamma and digital gain, the noise has the promised variance; taken
// where nothing is cut off.
TEST(SensorRecipe, HasTheMeanAndTheNoiseThatItPromises) {
  for (const auto& [level, value, light] :
       {std::tuple{0.0, 0.5, 1.0}, std::tuple{0.3, 0.8, 1.0}, std::tuple{0.0, 0.8, 0.125}}) {
    const cv::Mat flat(400, 400, CV_16UC1, cv::Scalar(value * 65535.0));
    const SensorLevel sensor = SensorLevelAt(level, light);
    DegradeOptions options = Options(DegradeRecipe::kSensor, level);
    options.light = light;
    cv::Mat linear;
    DegradeFrame(flat, options, 0).convertTo(linear, CV_64F, 1.0 / 255.0);
    cv::pow(linear, 2.2, linear);
    linear /= sensor.digital_gain;
    cv::Scalar mean;
    cv::Scalar sigma;
    cv::meanStdDev(linear, mean, sigma);
    const double expected = light * SensorLevelAt(level).gain * std::pow(value, 2.2);
    EXPECT_NEAR(mean[0] / expected, 1.0, 0.01) << level << ", " << light;
    EXPECT_NEAR(sigma[0] / std::sqrt(sensor.shot * expected + sensor.read), 1.0, 0.03)
        << level << ", " << light;
  }
}

TEST(SensorRecipe, StaysDarkAndIsNoisierThanThePaper) {
  const cv::Mat flat(300, 300, CV_8UC1, cv::Scalar(128));
  const Statistics hard =
      MeanAndSpread(DegradeFrame(flat, Options(DegradeRecipe::kSensor, 2.0), 0));
  EXPECT_LT(hard.mean, 0.35);
  EXPECT_GT(hard.mean, 0.1);
  EXPECT_GT(hard.sigma, 0.1);
}

// Smearing is as long as the shutter is open, and displaces nothing.
TEST(SensorRecipe, MotionBlurIsCentred) {
  const cv::Mat sharp = test::SpotsImage(200, 160, 0.0, 0.0, CV_16U);
  DegradeOptions options = Options(DegradeRecipe::kSensor, 0.4);
  const SensorLevel level = SensorLevelAt(options.level);
  ASSERT_GT(level.shutter, 0.1);
  const cv::Mat motion(sharp.size(), CV_32FC2, cv::Scalar(24.0, -12.0));
  cv::Mat blurred = cv::Mat::zeros(sharp.size(), CV_32F);
  cv::Mat expected = cv::Mat::zeros(sharp.size(), CV_32F);
  cv::Mat picture;
  for (std::uint32_t i = 0; i < 40; ++i) {  // the mean of many has little noise
    DegradeFrame(sharp, options, i, motion).convertTo(picture, CV_32F, 1.0 / 255.0);
    cv::pow(picture, 2.2, picture);
    blurred += picture / 40.0;
  }
  for (int i = -20; i <= 20; ++i) {
    const double t = level.shutter * i / 41.0;
    test::SpotsImage(200, 160, 24.0 * t, -12.0 * t, CV_16U).convertTo(picture, CV_32F, 1 / 65535.);
    cv::pow(picture, 2.2, picture);
    expected += level.gain * level.digital_gain * picture / 41.0;
  }
  const cv::Rect inside(20, 20, 160, 120);
  EXPECT_LT(cv::norm(blurred(inside), expected(inside), cv::NORM_L2) / std::sqrt(inside.area()),
            0.01);
  std::vector<double> reference;
  std::vector<Eigen::Vector2d> at;
  for (int y = inside.y; y < inside.br().y; ++y) {
    for (int x = inside.x; x < inside.br().x; ++x) {
      reference.push_back(expected.at<float>(y, x));
      at.emplace_back(x, y);
    }
  }
  EXPECT_LT(test::Displacement(reference, blurred, at).norm(), 0.03);
}

TEST(DegradeFrame, NoiseBelongsToSeedAndFrame) {
  const cv::Mat flat(50, 60, CV_8UC1, cv::Scalar(100));
  DegradeOptions options = Options(DegradeRecipe::kPaper, 1.0);
  const auto differs = [](const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b) > 0.0; };
  const cv::Mat first = DegradeFrame(flat, options, 7);
  EXPECT_FALSE(differs(first, DegradeFrame(flat, options, 7)));
  EXPECT_TRUE(differs(first, DegradeFrame(flat, options, 8)));
  options.seed = 2;
  EXPECT_TRUE(differs(first, DegradeFrame(flat, options, 7)));
}

TEST(DegradeFrame, SixteenBitsAreTheSameIntensities) {
  const DegradeOptions options = Options(DegradeRecipe::kPaper, 1.0);
  const cv::Mat eight(50, 60, CV_8UC1, cv::Scalar(100));
  const cv::Mat sixteen(50, 60, CV_16UC1, cv::Scalar(100 * 257));
  EXPECT_EQ(cv::norm(DegradeFrame(eight, options, 0), DegradeFrame(sixteen, options, 0)), 0.0);
}

TEST(Occluder, IsAnOpaqueBarOfEightyPixelsAndItsMask) {
  const cv::Mat scene(120, 320, CV_8UC1, cv::Scalar(77));
  DegradeOptions options;
  options.occluder_px_per_frame = 25.0;
  cv::Mat bar;
  for (std::uint32_t frame = 0; frame < 60; ++frame) {
    const OccludedFrame occluded = DrawOccluder(scene, options, frame);
    const int left = (25 * static_cast<int>(frame)) % (2 * 320 + 80) - 80;
    for (int x = 0; x < 320; ++x) {
      const bool covered = x >= left && x < left + 80;
      ASSERT_EQ(occluded.mask.at<std::uint8_t>(60, x), covered ? 255 : 0) << frame << " " << x;
      if (!covered) {
        ASSERT_EQ(occluded.gray.at<std::uint8_t>(60, x), 77);
      }
    }
    if (left >= 0 && left + 80 <= 320) {  // its pattern moves with it
      const cv::Mat now = occluded.gray(cv::Rect(left, 0, 80, 120));
      if (!bar.empty()) {
        EXPECT_EQ(cv::norm(bar, now), 0.0);
      }
      bar = now.clone();
    }
  }
  EXPECT_GT(MeanAndSpread(bar).sigma, 0.05);  // a pattern worth following
}

class DegradeClip : public testing::Test {
 protected:
  void SetUp() override {
    SyntheticSceneOptions options;
    options.scene = SceneName::kCloth;
    options.frames = 4;
    options.width_px = 320;
    options.height_px = 160;
    options.focal_px = 200.0;
    test::WriteSceneWithoutPictures(options, dir_ / "clip");
  }
  void Degrade(const DegradeOptions& options,
               const char* out,
               unsigned threads = 0,
               const FrameRange& range = {}) {
    const auto sequence = OpenSequence(dir_ / "clip", Layout::kAuto, range);
    DegradeSequence(
        *sequence, dir_ / "clip", sequence->KnownCamera(), options, dir_ / out, {}, threads);
  }
  TempDir dir_;
};

TEST_F(DegradeClip, KeepsTruthAndWritesTheOccludersMask) {
  DegradeOptions options = Options(DegradeRecipe::kSensor, 1.0);
  options.occluder_px_per_frame = 60.0;
  Degrade(options, "dark");
  const auto clean = OpenSequence(dir_ / "clip");
  const auto dark = OpenSequence(dir_ / "dark");
  const std::vector<Frame> before = test::ReadAll(*clean);
  const std::vector<Frame> after = test::ReadAll(*dark);
  ASSERT_EQ(after.size(), 4u);
  EXPECT_EQ(dark->KnownCamera()->fx, 200.0);
  for (std::size_t i = 0; i < 4; ++i) {
    const FrameIndex frame{static_cast<std::uint32_t>(i)};
    EXPECT_EQ(after[i].timestamp_ns, before[i].timestamp_ns);
    EXPECT_LT(cv::mean(after[i].gray)[0], 0.7 * cv::mean(before[i].gray)[0]);
    EXPECT_EQ(cv::norm(*dark->TrueDepth(frame), *clean->TrueDepth(frame)), 0.0);
    const Rigid3 same =
        dark->TrueCamFromWorld().at(frame) * clean->TrueCamFromWorld().at(frame).Inverse();
    EXPECT_LT(same.translation.norm(), 1e-12);
    EXPECT_EQ(cv::norm(*dark->OccluderMask(frame),
                       DrawOccluder(before[i].gray, options, ToInt(frame)).mask),
              0.0);
  }
  EXPECT_FALSE(clean->OccluderMask(FrameIndex{0}));
  EXPECT_EQ(ReadBytes(dir_ / "dark/scene.json"), ReadBytes(dir_ / "clip/scene.json"));
}

TEST_F(DegradeClip, BytesDoNotDependOnThreads) {
  for (const auto& [recipe, one, three] :
       {std::tuple(DegradeRecipe::kSensor, "one", "three"),
        std::tuple(DegradeRecipe::kPhone, "phone_one", "phone_three")}) {
    const DegradeOptions options = Options(recipe, 2.0);
    Degrade(options, one, 1);
    Degrade(options, three, 3);
    for (int i = 0; i < 4; ++i) {
      const std::string name = fmt::format("rgb/{:06}.png", i);
      EXPECT_EQ(ReadBytes(dir_ / one / name), ReadBytes(dir_ / three / name));
    }
  }
}

// The truth beside a phone's video is as with any recipe, and of the video nothing stays.
TEST_F(DegradeClip, PhoneVideoIsDecodedBesideItsTruth) {
  DegradeOptions options = Options(DegradeRecipe::kPhone, 1.0);
  options.occluder_px_per_frame = 60.0;
  Degrade(options, "phone");
  options.recipe = DegradeRecipe::kSensor;
  Degrade(options, "sensor");
  const auto phone = OpenSequence(dir_ / "phone");
  const auto sensor = OpenSequence(dir_ / "sensor");
  const std::vector<Frame> frames = test::ReadAll(*phone);
  const std::vector<Frame> others = test::ReadAll(*sensor);
  ASSERT_EQ(frames.size(), 4u);
  for (std::size_t i = 0; i < 4; ++i) {
    const FrameIndex frame{static_cast<std::uint32_t>(i)};
    EXPECT_EQ(frames[i].timestamp_ns, others[i].timestamp_ns);
    EXPECT_EQ(frames[i].gray.size(), others[i].gray.size());
    EXPECT_NEAR(cv::mean(frames[i].gray)[0], cv::mean(others[i].gray)[0], 6.0);
    EXPECT_EQ(cv::norm(*phone->TrueDepth(frame), *sensor->TrueDepth(frame)), 0.0);
    EXPECT_EQ(cv::norm(*phone->OccluderMask(frame), *sensor->OccluderMask(frame)), 0.0);
    cv::Mat change;
    cv::Mat noise;
    cv::Laplacian(frames[i].gray, change, CV_32F);
    cv::Laplacian(others[i].gray, noise, CV_32F);
    EXPECT_LT(MeanAndSpread(change).sigma, 0.5 * MeanAndSpread(noise).sigma);  // denoised
  }
  EXPECT_EQ(ReadBytes(dir_ / "phone/groundtruth.txt"), ReadBytes(dir_ / "sensor/groundtruth.txt"));
  EXPECT_EQ(ReadBytes(dir_ / "phone/scene.json"), ReadBytes(dir_ / "clip/scene.json"));
  EXPECT_FALSE(fs::exists(dir_ / "phone/rgb.partial.mp4"));
  EXPECT_FALSE(fs::exists(dir_ / "phone/rgb.partial.mp4.raw"));
}

TEST_F(DegradeClip, PhoneWithoutItsEncoderLeavesNothing) {
  const char* variable = std::getenv("PATH");
  ASSERT_NE(variable, nullptr);
  const std::string path = variable;
  setenv("PATH", dir_.path().c_str(), 1);
  EXPECT_THAT([&] { Degrade(Options(DegradeRecipe::kPhone, 1.0), "phone"); },
              ThrowsMessage<Error>(HasSubstr("apt install ffmpeg")));
  setenv("PATH", path.c_str(), 1);
  EXPECT_FALSE(fs::exists(dir_ / "phone"));
  EXPECT_FALSE(fs::exists(dir_ / "phone.partial"));
}

// Half the bits, and less of the picture is left.
TEST_F(DegradeClip, PhoneLosesMoreAtALowerBitRate) {
  const auto error = [&](const char* out, int bitrate_kbit) {
    DegradeOptions options = Options(DegradeRecipe::kPhone, 0.0);
    options.bitrate_kbit = bitrate_kbit;
    Degrade(options, out);
    const auto clip = OpenSequence(dir_ / "clip");
    const auto phone = OpenSequence(dir_ / out);
    return cv::norm(test::ReadAll(*clip)[0].gray, test::ReadAll(*phone)[0].gray);
  };
  EXPECT_GT(error("low", 20), 1.2 * error("high", 20000));
}

// Truth stays right for a part of a clip, and for a part of that.
TEST_F(DegradeClip, OfARangeRemembersWhichFramesOfTheSceneItShows) {
  Degrade(Options(DegradeRecipe::kPaper, 0.0), "part", 0, FrameRange::Parse("1:4:2"));
  const auto part = OpenSequence(dir_ / "part");
  EXPECT_EQ(part->FrameCount(), 2u);
  const auto scene = ReadSceneFile(dir_ / "part");
  ASSERT_TRUE(scene);
  EXPECT_EQ(scene->first_frame, 1);
  EXPECT_EQ(scene->frame_step, 2);
  const auto again = OpenSequence(dir_ / "part", Layout::kAuto, FrameRange::Parse("1:"));
  DegradeSequence(*again, dir_ / "part", again->KnownCamera(), DegradeOptions{}, dir_ / "last");
  EXPECT_EQ(ReadSceneFile(dir_ / "last")->first_frame, 3);
}

TEST_F(DegradeClip, RefusesToOverwriteItsInput) {
  EXPECT_THAT([&] { Degrade({}, "clip"); }, ThrowsMessage<Error>(HasSubstr("another folder")));
  EXPECT_THAT([&] { Degrade({}, "no/where"); }, ThrowsMessage<Error>(HasSubstr("no/where")));
  EXPECT_EQ(OpenSequence(dir_ / "clip")->FrameCount(), 4u);
}

TEST(DegradeSequence, WithoutAFrameThereIsNoClip) {
  const TempDir dir;
  for (int i = 0; i < 3; ++i) WriteImage(dir / fmt::format("in/{}.png", i), 200);
  const auto sequence = OpenSequence(dir / "in");
  for (int i = 0; i < 3; ++i) WriteBytes(dir / fmt::format("in/{}.png", i), "no picture");
  EXPECT_THAT(
      [&] {
        DegradeSequence(
            *sequence, dir / "in", std::nullopt, Options(DegradeRecipe::kSensor, 2.0), dir / "out");
      },
      ThrowsMessage<Error>(HasSubstr("there is no frame to degrade")));
  EXPECT_FALSE(fs::exists(dir / "out"));
}

TEST_F(DegradeClip, ReplacesNoClipThatOthersWrote) {
  fs::create_directories(dir_ / "tum/rgb");
  WriteBytes(dir_ / "tum/rgb/1305031102.175304.png", "precious");
  WriteBytes(dir_ / "tum/rgb.txt", "1305031102.175304 rgb/1305031102.175304.png\n");
  EXPECT_THAT([&] { TumWriter writer(dir_ / "tum"); },
              ThrowsMessage<Error>(HasSubstr("were not written by cohort")));
  EXPECT_TRUE(fs::exists(dir_ / "tum/rgb/1305031102.175304.png"));
}

TEST(DegradeSequence, TakesAPlainImageFolder) {
  const TempDir dir;
  for (int i = 0; i < 3; ++i) WriteImage(dir / fmt::format("in/{}.png", i), 200);
  const auto sequence = OpenSequence(dir / "in");
  DegradeSequence(
      *sequence, dir / "in", std::nullopt, Options(DegradeRecipe::kSensor, 2.0), dir / "out");
  const auto dark = OpenSequence(dir / "out");
  EXPECT_EQ(test::ReadAll(*dark).size(), 3u);
  EXPECT_FALSE(dark->KnownCamera());
  EXPECT_TRUE(dark->TrueCamFromWorld().empty());
}

// Few of the first frames are later than the others, so that a few and many have another rate.
TEST(DegradeSequence, APhonesBytesDoNotDependOnThreadsWhereTimesAreUneven) {
  if (!FindProgram("ffmpeg")) GTEST_SKIP() << "no ffmpeg";
  const TempDir dir;
  constexpr int kFrames = 14;
  std::string list;
  double seconds = 1.0;
  for (int i = 0; i < kFrames; ++i) {
    test::WriteImage(dir / fmt::format("clip/rgb/{}.png", i), 40 + 9 * i);
    list += fmt::format("{} rgb/{}.png\n", seconds, i);
    seconds += i < 4 ? 0.2 : 0.03;
  }
  test::WriteText(dir / "clip/rgb.txt", list);
  for (const unsigned threads : {1U, 3U}) {
    const auto sequence = OpenSequence(dir / "clip");
    DegradeSequence(*sequence,
                    dir / "clip",
                    std::nullopt,
                    Options(DegradeRecipe::kPhone, 2.0),
                    dir / std::to_string(threads),
                    {},
                    threads);
  }
  for (int i = 0; i < kFrames; ++i) {
    const std::string name = fmt::format("rgb/{:06}.png", i);
    EXPECT_EQ(ReadBytes(dir / "1" / name), ReadBytes(dir / "3" / name)) << i;
  }
}

}  // namespace
}  // namespace cohort
