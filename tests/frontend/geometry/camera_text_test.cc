#include "frontend/geometry/camera_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "frontend/core/error.h"
#include "tests/support/cameras.h"

namespace cohort {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(CameraText, CoefficientsAreInOpenCvsOrder) {
  const Camera eight =
      CameraFromWords({"500", "510", "320", "240", "1", "2", "3", "4", "5", "6", "7", "8"});
  EXPECT_EQ(eight.fx, 500);
  EXPECT_EQ(eight.fy, 510);
  EXPECT_EQ(eight.cx, 320);
  EXPECT_EQ(eight.cy, 240);
  EXPECT_EQ(eight.k1, 1);
  EXPECT_EQ(eight.k2, 2);
  EXPECT_EQ(eight.p1, 3);
  EXPECT_EQ(eight.p2, 4);
  EXPECT_EQ(eight.k3, 5);
  EXPECT_EQ(eight.k4, 6);
  EXPECT_EQ(eight.k5, 7);
  EXPECT_EQ(eight.k6, 8);
  EXPECT_EQ(eight.model, CameraModel::kPinhole);
  EXPECT_TRUE(eight.known);
  EXPECT_FALSE(CameraFromWords({"500", "510", "320", "240"}).HasDistortion());
  EXPECT_EQ(CameraFromWords({"500", "510", "320", "240", "0.1"}).k1, 0.1);
  EXPECT_EQ(CameraFromWords({"500", "510", "320", "240", "0.1", "-0.2"}).k2, -0.2);
  EXPECT_EQ(CameraFromWords({"5", "5", "3", "2", "0.1", "0", "0", "0", "-0.3"}).k3, -0.3);
}

TEST(CameraText, TheWordFisheyeSaysWhatTheCoefficientsAre) {
  const Camera camera = CameraFromWords({"5", "5", "3", "2", "fisheye", "1", "2", "3", "4"});
  EXPECT_EQ(camera.model, CameraModel::kFisheye);
  EXPECT_EQ(camera.k2, 2);
  EXPECT_EQ(camera.p1, 0);
  EXPECT_EQ(camera.k3, 3);
  EXPECT_EQ(camera.k4, 4);
}

TEST(CameraText, NamesWhatIsWrong) {
  const auto message = [](const std::vector<std::string>& words, const char* expected) {
    EXPECT_THAT([&] { CameraFromWords(words); }, ThrowsMessage<Error>(HasSubstr(expected)));
  };
  message({"1", "2", "3"}, "3 numbers: give fx,fy,cx,cy");
  message({"1", "x", "3", "4"}, "'x' is not a number");
  message({"1", "2", "3", "nan"}, "'nan' is not a number");
  message({"1", "2", "3", "4", ""}, "'' is not a number");
  message({"0", "2", "3", "4"}, "must be above 0");
  message({"1", "2", "3", "4", "0", "0", "0"}, "3 distortion coefficients: a pinhole camera has");
  message({"1", "2", "3", "4", "fisheye", "0"},
          "1 distortion coefficients: a fisheye camera has 4");
  message({"1", "2", "3", "4", "fish", "0", "0", "0", "0"}, "'fish' is not a number");
}

TEST(CameraText, WritesTheFewestCoefficientsThatHoldTheCamera) {
  Camera camera{.fx = 500.5, .fy = 510, .cx = 320, .cy = 240};
  EXPECT_THAT(WordsOfCamera(camera), ElementsAre("500.5", "510", "320", "240"));
  camera.k1 = 0.1;
  EXPECT_EQ(WordsOfCamera(camera).size(), 8u);
  EXPECT_EQ(WordsOfCamera(test::FreiburgCamera()).size(), 9u);
  EXPECT_EQ(WordsOfCamera(test::RationalCamera()).size(), 12u);
  for (const Camera& c :
       {camera, test::FreiburgCamera(), test::RationalCamera(), test::FisheyeCamera()}) {
    const Camera back = CameraFromWords(WordsOfCamera(c));
    EXPECT_EQ(back.model, c.model);
    for (const auto field : test::kCameraNumbers) {
      EXPECT_EQ(back.*field, c.*field);
    }
  }
}

}  // namespace
}  // namespace cohort
