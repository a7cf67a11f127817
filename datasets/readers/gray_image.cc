#include "datasets/readers/gray_image.h"

#include <climits>
#include <cstdint>
#include <opencv2/imgproc.hpp>
#include <string>
#include <string_view>
#include <utility>

#include "frontend/core/error.h"
#include "frontend/core/input_file.h"

namespace cohort {

namespace {

// Decoders fill what a cut JPEG lacks with grey and say nothing. After the headers (segments with
// their lengths) comes the coded picture, in which the end mark FF D9 cannot occur by chance.
bool IsCutJpeg(std::string_view bytes) {
  if (!bytes.starts_with("\xFF\xD8\xFF")) return false;
  std::size_t at = 2;
  while (at + 4 <= bytes.size() && bytes[at] == '\xFF' && bytes[at + 1] != '\xDA') {
    const auto high = static_cast<unsigned char>(bytes[at + 2]);
    const auto low = static_cast<unsigned char>(bytes[at + 3]);
    at += 2 + high * 256U + low;
  }
  return bytes.find("\xFF\xD9", at) == std::string_view::npos;
}

}  // namespace

cv::Mat ReadImage(const std::filesystem::path& file, int flags) {
  constexpr std::uint64_t kMaxBytes = INT_MAX;  // OpenCV's
  std::string bytes = ReadBytes(file, kMaxBytes);
  if (bytes.empty()) ThrowError("cannot decode {}: the file is empty", file.string());
  cv::Mat picture;
  if (!IsCutJpeg(bytes)) {
    try {
      picture =
          cv::imdecode(cv::Mat(1, static_cast<int>(bytes.size()), CV_8UC1, bytes.data()), flags);
    } catch (const cv::Exception& e) {
      ThrowError("cannot decode {}: {}", file.string(), e.err);
    }
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

void SetPicture(cv::Mat picture, std::string_view what, Frame& frame) {
  frame.gray = ToGray(picture, what);
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
