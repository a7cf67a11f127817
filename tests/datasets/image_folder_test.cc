#include "datasets/image_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

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

}  // namespace
}  // namespace cohort
