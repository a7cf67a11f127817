#include "frontend/tracks/frame_name.h"

#include <gtest/gtest.h>

#include <limits>

namespace cohort {
namespace {

TEST(FrameName, HasSixDigitsOrMore) {
  EXPECT_EQ(NumberedFrameName(FrameIndex{0}), "frame_000000.png");
  EXPECT_EQ(NumberedFrameName(FrameIndex{123}), "frame_000123.png");
  EXPECT_EQ(NumberedFrameName(FrameIndex{1'000'000}), "frame_1000000.png");
}

TEST(FrameName, IsKnownAgain) {
  for (const std::uint32_t frame : {0U, 999'999U, std::numeric_limits<std::uint32_t>::max()}) {
    EXPECT_TRUE(IsNumberedFrameName(NumberedFrameName(FrameIndex{frame}))) << frame;
  }
}

TEST(FrameName, IsNoOtherName) {
  for (const char* name : {"",
                           "frame_",
                           ".png",
                           "frame_.png",
                           "frame_12345.png",
                           "frame_00012a.png",
                           "frame_000123.jpg",
                           "frame_000123.png.partial",
                           "my_frame_000123.png",
                           "frame_-00123.png",
                           "frame_000123.PNG"}) {
    EXPECT_FALSE(IsNumberedFrameName(name)) << name;
  }
}

}  // namespace
}  // namespace cohort
