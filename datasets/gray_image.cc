#include "datasets/gray_image.h"

#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "frontend/core/error.h"

namespace cohort {

cv::Mat ReadImage(const std::filesystem::path& file) {
  // imdecode instead of imread: the reason is ours to tell, and no line goes to stderr.
  std::ifstream stream(file, std::ios::binary);
  if (!stream) ThrowError("cannot read {}: {}", file.string(), std::strerror(errno));
  const std::vector<char> bytes{std::istreambuf_iterator<char>(stream), {}};
  if (bytes.empty()) ThrowError("cannot decode {}: the file is empty", file.string());
  cv::Mat picture;
  try {
    picture = cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception& e) {
    ThrowError("cannot decode {}: {}", file.string(), e.err);
  }
  if (picture.empty()) {
    ThrowError("cannot decode {}: it is damaged, cut short or no image", file.string());
  }
  return picture;
}

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
