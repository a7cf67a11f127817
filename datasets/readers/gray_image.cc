#include "datasets/readers/gray_image.h"

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <string_view>
#include <utility>

#include "frontend/core/error.h"

namespace cohort {

cv::Mat ToGray(const cv::Mat& picture, std::string_view what) {
  if (picture.depth() != CV_8U && picture.depth() != CV_16U) {
    ThrowError(
        "{} has {} pixels: give images of 8 or 16 bits", what, cv::typeToString(picture.type()));
  }
  if (picture.channels() == 1) return picture;
  cv::Mat gray;
  cv::cvtColor(picture, gray, picture.channels() == 4 ? cv::COLOR_BGRA2GRAY : cv::COLOR_BGR2GRAY);
  return gray;
}

cv::Mat MaskOfAlpha(const cv::Mat& picture) {
  if (picture.channels() != 4) return {};
  cv::Mat alpha;
  cv::extractChannel(picture, alpha, 3);
  double least = 0.0;
  double most = 0.0;
  cv::minMaxLoc(alpha, &least, &most);
  if (least == most) return {};
  return alpha >= (picture.depth() == CV_16U ? 32768.0 : 128.0);
}

void SetPicture(cv::Mat picture, std::string_view what, Frame& frame) {
  frame.gray = ToGray(picture, what);
  frame.mask = MaskOfAlpha(picture);
  frame.color = picture.channels() >= 3 ? std::move(picture) : cv::Mat();
}

void RequireSize(cv::Size size, cv::Size expected, std::string_view what) {
  if (size != expected) {
    ThrowError("{} is {}x{}, the first frame is {}x{}: all must have one size",
               what,
               size.width,
               size.height,
               expected.width,
               expected.height);
  }
}

}  // namespace cohort
