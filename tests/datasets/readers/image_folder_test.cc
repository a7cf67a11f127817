#include "datasets/readers/image_folder.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "datasets/open_sequence.h"
#include "frontend/core/error.h"
#include "tests/datasets/fixtures.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using test::Names;
using test::TempDir;
using test::WriteImage;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(NaturalOrder, ComparesRunsOfDigitsAsNumbers) {
  EXPECT_TRUE(NaturalLess("frame2.png", "frame10.png"));
  EXPECT_TRUE(NaturalLess("a1b20", "a1b100"));
  EXPECT_TRUE(NaturalLess("a007", "a8"));
  EXPECT_TRUE(NaturalLess("a.seq9.png", "a.seq10.png"));
  EXPECT_TRUE(NaturalLess("a", "a1"));
  EXPECT_FALSE(NaturalLess("b1", "a2"));
  EXPECT_FALSE(NaturalLess("a1", "a1"));
  // Equal numbers: one order, not both.
  EXPECT_NE(NaturalLess("a01", "a1"), NaturalLess("a1", "a01"));
  EXPECT_TRUE(NaturalLess("1403636579763555584", "14036365797635555840"));
}

TEST(ImageFolder, ReadsImagesInNaturalOrderAtThirtyFramesASecond) {
  const TempDir dir;
  for (const int i : {10, 2, 1}) WriteImage(dir / fmt::format("frame{}.png", i), i);
  std::ofstream(dir / "notes.txt") << "no image";
  std::ofstream(dir / "._frame3.png") << "a macOS leftover";

  const auto sequence = OpenSequence(dir.path());
  EXPECT_EQ(sequence->Name(), dir.path().filename());
  EXPECT_EQ(sequence->ImageRoot(), dir.path());
  EXPECT_EQ(sequence->FrameCount(), 3u);
  EXPECT_FALSE(sequence->KnownCamera().has_value());
  EXPECT_TRUE(sequence->TrueCamFromWorld().empty());
  EXPECT_FALSE(sequence->TrueDepth(FrameIndex{0}).has_value());
  EXPECT_FALSE(sequence->OccluderMask(FrameIndex{0}).has_value());

  for (int round = 0; round < 2; ++round) {
    const std::vector<Frame> frames = test::ReadAll(*sequence);
    ASSERT_THAT(Names(frames), ElementsAre("frame1.png", "frame2.png", "frame10.png"));
    EXPECT_EQ(frames[2].index, FrameIndex{2});
    EXPECT_EQ(frames[2].timestamp_ns, 66'666'666);
    EXPECT_EQ(frames[2].gray.type(), CV_8UC1);
    EXPECT_EQ(frames[2].gray.at<std::uint8_t>(5, 5), 10);
    EXPECT_EQ(sequence->Warning(), "");
    sequence->Rewind();
  }
}

TEST(ImageFolder, RangesAndStridesKeepTheSourcesFrameIndices) {
  const TempDir dir;
  for (int i = 0; i < 10; ++i) WriteImage(dir / fmt::format("{}.pgm", i), i);
  const auto read = [&](const char* range) {
    const auto sequence = OpenSequence(dir.path(), Layout::kAuto, FrameRange::Parse(range));
    std::vector<Frame> frames = test::ReadAll(*sequence);
    EXPECT_EQ(sequence->FrameCount(), frames.size()) << range;
    for (const Frame& frame : frames) {
      EXPECT_EQ(frame.gray.at<std::uint8_t>(0, 0), ToInt(frame.index)) << range;
    }
    return test::Indices(frames);
  };
  EXPECT_THAT(read("2:5"), ElementsAre(2, 3, 4));
  EXPECT_THAT(read("7:"), ElementsAre(7, 8, 9));
  EXPECT_THAT(read("1:9:3"), ElementsAre(1, 4, 7));
  EXPECT_THAT(read("::4"), ElementsAre(0, 4, 8));
  EXPECT_THAT(read("9:100"), ElementsAre(9));
  EXPECT_THAT([&] { read("10:"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("10 frames"), HasSubstr("frame 10"))));
}

TEST(ImageFolder, ReadsAGlobAndASingleImage) {
  const TempDir dir;
  WriteImage(dir / "a/left2.png", 2);
  WriteImage(dir / "a/left10.png", 10);
  WriteImage(dir / "a/right1.png", 1);
  WriteImage(dir / "b/left1.png", 1);

  auto sequence = OpenSequence(dir / "a/left*.png");
  EXPECT_EQ(sequence->ImageRoot(), dir / "a");
  EXPECT_EQ(sequence->Name(), "a");
  EXPECT_THAT(Names(test::ReadAll(*sequence)), ElementsAre("left2.png", "left10.png"));

  // Wildcards in folders: names are relative to the folder before the first one.
  sequence = OpenSequence(dir / "?/left*.png");
  EXPECT_EQ(sequence->ImageRoot(), dir.path());
  EXPECT_THAT(Names(test::ReadAll(*sequence)),
              ElementsAre("a/left2.png", "a/left10.png", "b/left1.png"));

  sequence = OpenSequence(dir / "a/left10.png");
  EXPECT_THAT(Names(test::ReadAll(*sequence)), ElementsAre("left10.png"));

  EXPECT_THAT([&] { OpenSequence(dir / "a/*.jpg"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("no images"), HasSubstr("a/*.jpg"))));
}

TEST(ImageFolder, AFolderWhoseNameLooksLikeAGlobIsAFolder) {
  const TempDir dir;
  WriteImage(dir / "take[1]/0.png", 7);
  EXPECT_EQ(OpenSequence(dir / "take[1]")->FrameCount(), 1u);
}

TEST(ImageFolder, ConvertsColourAlphaAnd16BitsToGrey) {
  const TempDir dir;
  // Blue 10, green 200, red 60: 0.114 * 10 + 0.587 * 200 + 0.299 * 60 = 136.48.
  cv::imwrite((dir / "0_colour.png").string(), cv::Mat(48, 64, CV_8UC3, cv::Scalar(10, 200, 60)));
  cv::imwrite((dir / "1_alpha.png").string(), cv::Mat(48, 64, CV_8UC4, cv::Scalar(10, 200, 60, 0)));
  cv::imwrite((dir / "2_deep.png").string(), cv::Mat(48, 64, CV_16UC1, cv::Scalar(54321)));
  cv::imwrite((dir / "3_deep_colour.tif").string(),
              cv::Mat(48, 64, CV_16UC3, cv::Scalar(1000, 20000, 6000)));

  const std::vector<Frame> frames = test::ReadAll(*OpenSequence(dir.path()));
  ASSERT_EQ(frames.size(), 4u);
  EXPECT_EQ(frames[0].gray.type(), CV_8UC1);
  EXPECT_EQ(frames[0].gray.at<std::uint8_t>(3, 4), 136);
  EXPECT_EQ(frames[1].gray.type(), CV_8UC1);
  EXPECT_EQ(frames[1].gray.at<std::uint8_t>(3, 4), 136);
  EXPECT_EQ(frames[2].gray.type(), CV_16UC1);
  EXPECT_EQ(frames[2].gray.at<std::uint16_t>(3, 4), 54321);
  EXPECT_EQ(frames[3].gray.type(), CV_16UC1);
  EXPECT_NEAR(frames[3].gray.at<std::uint16_t>(3, 4), 13648, 1);
}

cv::Mat Deep(int value, int type = CV_16UC1) {
  return {48, 64, type, cv::Scalar(value, value, value, 65535)};
}

std::vector<int> DeepValues(Sequence& sequence) {
  std::vector<int> values;
  for (const Frame& frame : test::ReadAll(sequence)) {
    EXPECT_EQ(frame.gray.type(), CV_16UC1);
    values.push_back(frame.gray.at<std::uint16_t>(3, 4));
  }
  return values;
}

TEST(ImageFolder, AlphaIsAMask) {
  const TempDir dir;
  for (const int depth : {CV_8U, CV_16U}) {
    const double most = depth == CV_8U ? 255.0 : 65535.0;
    cv::Mat cut(test::kHeight, test::kWidth, CV_MAKETYPE(depth, 4), cv::Scalar::all(most));
    cut.colRange(0, 10).setTo(cv::Scalar(0, 0, 0, 0));
    cv::imwrite(dir / "cut.png", cut);
    const auto frame = OpenSequence(dir / "cut.png")->Next();
    EXPECT_EQ(frame->mask.type(), CV_8UC1);
    EXPECT_EQ(cv::countNonZero(frame->mask), (test::kWidth - 10) * test::kHeight);
    EXPECT_EQ(frame->mask.at<std::uint8_t>(5, 9), 0);
  }
  for (const int alpha : {0, 255}) {  // the same everywhere: an unused channel
    const cv::Mat all(test::kHeight, test::kWidth, CV_8UC4, cv::Scalar(9, 9, 9, alpha));
    cv::imwrite(dir / "all.png", all);
    EXPECT_TRUE(OpenSequence(dir / "all.png")->Next()->mask.empty()) << alpha;
  }
}

TEST(ImageFolder, BitsThatASensorLeavesEmptyAreNoDarkness) {
  struct Sensor {
    int brightest;
    int white;
  };
  for (const auto& [brightest, white] : {Sensor{250, 255},
                                         Sensor{256, 1023},
                                         Sensor{4095, 4095},
                                         Sensor{4096, 65535},
                                         Sensor{65535, 65535}}) {
    for (const int type : {CV_16UC1, CV_16UC4}) {
      const TempDir dir;
      for (const int i : {0, 1, 2}) {
        cv::imwrite(dir / fmt::format("{}.png", i), Deep(i == 1 ? brightest : brightest / 2, type));
      }
      const auto spread = [white = white](int value) {
        return static_cast<int>(std::lround(65535.0 / white * value));
      };
      EXPECT_THAT(DeepValues(*OpenSequence(dir.path())),
                  ElementsAre(spread(brightest / 2), spread(brightest), spread(brightest / 2)))
          << brightest;
      // As bright as in the whole clip.
      EXPECT_THAT(DeepValues(*OpenSequence(dir.path(), Layout::kAuto, FrameRange::Parse("2:"))),
                  ElementsAre(spread(brightest / 2)));
    }
  }
}

TEST(ImageFolder, APictureBrighterThanTheWhiteOfOthersIsTold) {
  const TempDir dir;
  constexpr int kImages = 40;  // of which the second is not looked at for the white
  for (int i = 0; i < kImages; ++i) {
    cv::imwrite(dir / fmt::format("{}.png", i), Deep(i == 1 ? 1100 : 900));
  }
  const auto sequence = OpenSequence(dir.path());
  const std::vector<int> values = DeepValues(*sequence);
  ASSERT_EQ(values.size(), kImages);
  EXPECT_EQ(values[0], 57655);  // 900 of 1023
  EXPECT_EQ(values[1], 65535);
  EXPECT_THAT(sequence->Warning(), AllOf(HasSubstr("1.png is brighter"), HasSubstr("1023")));
}

TEST(ImageFolder, RefusesFloatingPointImages) {
  const TempDir dir;
  cv::imwrite((dir / "0.tif").string(), cv::Mat(48, 64, CV_32FC1, cv::Scalar(0.5)));
  const auto sequence = OpenSequence(dir.path());
  EXPECT_THAT([&] { sequence->Next(); },
              ThrowsMessage<Error>(AllOf(HasSubstr("0.tif"), HasSubstr("8 or 16 bits"))));
}

TEST(ImageFolder, AnImageOfAnotherSizeIsAnErrorNamingBothSizes) {
  const TempDir dir;
  WriteImage(dir / "0.png", 0);
  WriteImage(dir / "1.png", 1, {32, 24});
  const auto sequence = OpenSequence(dir.path());
  ASSERT_TRUE(sequence->Next());
  EXPECT_THAT(
      [&] { sequence->Next(); },
      ThrowsMessage<Error>(AllOf(HasSubstr("1.png"), HasSubstr("32x24"), HasSubstr("64x48"))));
}

TEST(ImageFolder, ALinkThatLeadsToItselfEndsTheSequenceAsAFileThatIsGone) {
  const TempDir dir;
  for (const int i : {1, 2, 4}) WriteImage(dir / fmt::format("{}.png", i), i);
  std::filesystem::create_symlink("3.png", dir / "3.png");
  const auto sequence = OpenSequence(dir.path());
  EXPECT_EQ(test::ReadAll(*sequence).size(), 2u);
  EXPECT_THAT(sequence->Warning(), AllOf(HasSubstr("2 frames of 4"), HasSubstr("3.png")));
}

// A cut JPEG too, of which decoders make a picture whose rest is grey.
TEST(ImageFolder, AnImageThatCannotBeDecodedEndsTheSequenceAndIsSaid) {
  for (const char* name : {"3.png", "3.jpg", "3.tif", "3.pgm"}) {
    const TempDir dir;
    for (const int i : {1, 2, 4}) WriteImage(dir / fmt::format("{}.png", i), i);
    cv::Mat noise(48, 64, CV_8UC1);
    cv::randu(noise, 0, 256);
    cv::imwrite((dir / name).string(), noise);
    EXPECT_EQ(test::ReadAll(*OpenSequence(dir.path())).size(), 4u) << name;

    test::CutFile(dir / name, 0.6);
    const auto sequence = OpenSequence(dir.path());
    EXPECT_EQ(test::ReadAll(*sequence).size(), 2u) << name;
    EXPECT_THAT(sequence->Warning(), AllOf(HasSubstr("2 frames of 4"), HasSubstr(name)));
    EXPECT_EQ(sequence->FrameCount(), 2u);
    sequence->Rewind();
    EXPECT_EQ(test::ReadAll(*sequence).size(), 2u) << name;
    EXPECT_NE(sequence->Warning(), "");
  }
}

// It may be whole: the clip must not seem to be a shorter one.
TEST(ImageFolder, AnImageThatTheSystemDoesNotGiveIsAnError) {
  const TempDir dir;
  for (const int i : {1, 2, 4}) WriteImage(dir / fmt::format("{}.png", i), i);
  std::filesystem::create_symlink("/proc/self/mem", dir / "3.png");  // its first byte is an EIO
  const auto sequence = OpenSequence(dir.path());
  ASSERT_TRUE(sequence->Next());
  ASSERT_TRUE(sequence->Next());
  EXPECT_THAT([&] { sequence->Next(); },
              ThrowsMessage<SystemError>(AllOf(HasSubstr("3.png"), HasSubstr("Input/output"))));
}

TEST(ImageFolder, AFirstImageThatCannotBeDecodedIsAnError) {
  const TempDir dir;
  std::ofstream(dir / "0.png") << "no image";
  WriteImage(dir / "1.png", 1);
  EXPECT_THAT([&] { OpenSequence(dir.path()); }, ThrowsMessage<Error>(HasSubstr("0.png")));
  std::ofstream(dir / "0.png") << "";
  EXPECT_THAT([&] { OpenSequence(dir.path()); },
              ThrowsMessage<Error>(AllOf(HasSubstr("0.png"), HasSubstr("empty"))));
}

TEST(ImageFolder, ReadsTheCastleOfDebiansVispImagesData) {
  const std::filesystem::path folder =
      "/usr/share/visp-images-data/ViSP-images/mbt-depth/castel/castel";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no package visp-images-data";
  const auto sequence = OpenSequence(folder);
  const std::vector<Frame> frames = test::ReadAll(*sequence);
  ASSERT_EQ(frames.size(), 30u);
  EXPECT_EQ(frames.back().name, "image_0029.pgm");
  EXPECT_EQ(frames.back().gray.size(), cv::Size(640, 480));
}

TEST(OpenSequence, SaysWhatItLookedForInAFolderOfAnotherKind) {
  const TempDir dir;
  std::ofstream(dir / "notes.txt") << "nothing";
  EXPECT_THAT([&] { OpenSequence(dir.path()); },
              ThrowsMessage<Error>(AllOf(HasSubstr(dir.path().string()),
                                         HasSubstr("no images"),
                                         HasSubstr("rgb.txt"),
                                         HasSubstr("mav0/cam0/data.csv"),
                                         HasSubstr("image_0"))));
  WriteImage(dir / "frames/0.png", 0);
  EXPECT_THAT([&] { OpenSequence(dir.path()); },
              ThrowsMessage<Error>(HasSubstr("there are images in " + (dir / "frames").string())));
}

Layout LayoutNamed(std::string_view name) {
  for (const auto& [text, layout] : kLayoutNames) {
    if (text == name) return layout;
  }
  throw std::invalid_argument(std::string(name));
}

TEST(OpenSequence, NamesAMissingInputAndAWrongLayout) {
  const TempDir dir;
  WriteImage(dir / "0.png", 0);
  EXPECT_THAT([&] { OpenSequence(dir / "missing.mp4"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("no such file"), HasSubstr("missing.mp4"))));
  EXPECT_THAT([&] { OpenSequence(dir.path(), LayoutNamed("tum")); },
              ThrowsMessage<Error>(AllOf(HasSubstr("tum"), HasSubstr("rgb.txt"))));
  EXPECT_THAT([&] { OpenSequence(dir.path(), LayoutNamed("euroc")); },
              ThrowsMessage<Error>(HasSubstr("mav0/cam0/data.csv")));
  EXPECT_THAT([&] { OpenSequence(dir.path(), LayoutNamed("kitti")); },
              ThrowsMessage<Error>(HasSubstr("image_0")));
  EXPECT_THAT([&] { OpenSequence(dir.path(), Layout::kVideo); },
              ThrowsMessage<Error>(HasSubstr("is a folder")));
  EXPECT_THAT([&] { OpenSequence(dir / "0.png", LayoutNamed("kitti")); },
              ThrowsMessage<Error>(HasSubstr("is a file")));
}

TEST(FrameRange, ParsesPythonSlicesAndRefusesTheRest) {
  const auto parse = [](const char* text) {
    const FrameRange range = FrameRange::Parse(text);
    return fmt::format("{} {} {}", range.first, range.end.value_or(0), range.stride);
  };
  EXPECT_EQ(parse("3:10"), "3 10 1");
  EXPECT_EQ(parse("3:10:2"), "3 10 2");
  EXPECT_EQ(parse("3:"), "3 0 1");
  EXPECT_EQ(parse("3::2"), "3 0 2");
  EXPECT_EQ(parse(":10"), "0 10 1");
  EXPECT_EQ(parse(":"), "0 0 1");
  for (const char* text : {"",
                           "5",
                           "a:b",
                           "-1:5",
                           "1:2:3:4",
                           "5:5",
                           "6:5",
                           "1:9:0",
                           "1.5:2",
                           "1: 2",
                           "0:99999999999"}) {
    EXPECT_THAT([&] { parse(text); },
                ThrowsMessage<UsageError>(HasSubstr(fmt::format("'{}'", text))));
  }
}

TEST(FrameRange, CountsItsFramesOfASource) {
  EXPECT_EQ(FrameRange{}.Count(7), 7u);
  EXPECT_EQ(FrameRange::Parse("2:7:3").Count(100), 2u);
  EXPECT_EQ(FrameRange::Parse("2:8:3").Count(100), 2u);
  EXPECT_EQ(FrameRange::Parse("2:9:3").Count(100), 3u);
  EXPECT_EQ(FrameRange::Parse("2::3").Count(3), 1u);
  EXPECT_EQ(FrameRange::Parse("5:").Count(5), 0u);
  EXPECT_EQ(FrameRange::Parse("::4000000000").Count(5), 1u);
}

// GDAL, which OpenCV would ask, opens other files and addresses that such a picture names.
TEST(ImageFolder, TheFirstBytesSayWhetherItIsAPicture) {
  // A portable bitmap by its first bytes alone, DICOM by those at 128: GDCM aborts on it.
  const std::string dicom = std::string("P4").append(126, '\0').append("DICM\xFF\xFF");
  for (const std::string& bytes : {std::string("<VRTDataset rasterXSize=\"4\" rasterYSize=\"3\"/>"),
                                   std::string("NITF02.10"),
                                   std::string("GIF89a"),
                                   std::string("\x76\x2F\x31\x01"),
                                   std::string("#?RADIANCE\n"),
                                   dicom}) {
    const TempDir dir;
    test::WriteText(dir / "0.png", bytes);
    EXPECT_THAT([&] { OpenSequence(dir.path()); },
                ThrowsMessage<Error>(AllOf(HasSubstr("0.png"), HasSubstr("not a PNG"))))
        << bytes;
  }
  for (const char* ending : {"png", "jpg", "bmp", "tif", "pgm", "webp", "jp2", "ras"}) {
    const TempDir dir;
    for (const int i : {0, 1}) {
      cv::imwrite((dir / fmt::format("{}.{}", i, ending)).string(),
                  cv::Mat(64, 64, CV_8UC1, 90 + i));
    }
    EXPECT_EQ(test::ReadAll(*OpenSequence(dir.path())).size(), 2u) << ending;
  }
}

// ITU T.81, B.1.1.2: any number of FF may stand before a marker.
TEST(ImageFolder, AJpegMayHaveFillBytes) {
  cv::Mat noise(48, 64, CV_8UC1);
  cv::randu(noise, 0, 256);
  std::vector<std::uint8_t> plain;
  cv::imencode(".jpg", noise, plain);
  std::string bytes(plain.begin(), plain.end());
  bytes.insert(2, "\xFF\xFF\xFF");
  const TempDir dir;
  test::WriteText(dir / "0.jpg", bytes);
  const std::vector<Frame> frames = test::ReadAll(*OpenSequence(dir.path()));
  ASSERT_EQ(frames.size(), 1u);
  EXPECT_EQ(cv::norm(frames[0].gray, cv::imdecode(plain, cv::IMREAD_GRAYSCALE)), 0.0);

  const auto damaged = ThrowsMessage<Error>(HasSubstr("damaged"));
  test::WriteText(dir / "0.jpg", bytes.substr(0, bytes.size() / 2));
  EXPECT_THAT([&] { OpenSequence(dir.path()); }, damaged);
  test::WriteText(dir / "0.jpg", "\xFF\xD8" + std::string(100, '\xFF'));
  EXPECT_THAT([&] { OpenSequence(dir.path()); }, damaged);
}

TEST(ImageFolder, WhatSeveralBracesMatchIsOneFrame) {
  const TempDir dir;
  for (const char* name : {"left1.png", "left2.png", "right1.png"}) WriteImage(dir / name, 1);
  const auto sequence = OpenSequence(dir / "{left,r,*1}*.png");
  EXPECT_THAT(Names(test::ReadAll(*sequence)), ElementsAre("left1.png", "left2.png", "right1.png"));
}

// As lost+found is on a disk of its own.
TEST(OpenSequence, AFolderThatMayNotBeReadIsNoPlaceToLookFor) {
  const TempDir dir;
  std::filesystem::create_directory(dir / "a_lost");
  WriteImage(dir / "c/0.png", 0);
  WriteImage(dir / "b/0.png", 0);
  std::filesystem::permissions(dir.path(), std::filesystem::perms(0755));
  std::filesystem::permissions(dir / "a_lost", std::filesystem::perms::none);
  const uid_t user = geteuid();
  if (user == 0) {
    ASSERT_EQ(seteuid(65533), 0);  // root may read all
  }
  EXPECT_THAT([&] { OpenSequence(dir.path()); },
              ThrowsMessage<Error>(AllOf(HasSubstr("nothing to read"),
                                         HasSubstr("images in " + (dir / "b").string()))));
  ASSERT_EQ(seteuid(user), 0);
  std::filesystem::permissions(dir / "a_lost", std::filesystem::perms::owner_all);
}

TEST(ImageFolder, BracesThatStandForMillionsAreNotListed) {
  const TempDir dir;
  std::string pattern = dir / "frame";
  for (int i = 0; i < 40; ++i) pattern += "{,}";
  EXPECT_THAT([&] { OpenSequence(pattern + "*.png"); },
              ThrowsMessage<Error>(HasSubstr("more than 10000 names")));
}

}  // namespace
}  // namespace cohort
