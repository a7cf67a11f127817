#include "frontend/image/read_image.h"

#include <algorithm>
#include <array>
#include <climits>
#include <cstdint>
#include <string>
#include <string_view>

#include "frontend/core/error.h"
#include "frontend/storage/input_file.h"

namespace cohort {

using std::string_view_literals::operator""sv;

namespace {

// Decoders silently fill the missing part of a truncated JPEG with grey. After the headers
// (segments with their lengths, each preceded by any number of FF) comes the coded picture, in
// which the end marker FF D9 cannot occur by chance.
bool IsCutJpeg(std::string_view bytes) {
  if (!bytes.starts_with("\xFF\xD8\xFF")) return false;
  std::size_t at = 2;
  while (at + 4 <= bytes.size() && bytes[at] == '\xFF' && bytes[at + 1] != '\xDA') {
    if (bytes[at + 1] == '\xFF') {
      ++at;
      continue;
    }
    const auto high = static_cast<unsigned char>(bytes[at + 2]);
    const auto low = static_cast<unsigned char>(bytes[at + 3]);
    at += 2 + high * 256U + low;
  }
  return bytes.find("\xFF\xD9", at) == std::string_view::npos;
}

// The first bytes of the supported formats. OpenCV passes others to libraries that access more than
// the given bytes: GDAL has formats that refer to other files and addresses, and DICM makes GDCM
// abort.
constexpr std::array<std::string_view, 13> kPictureMarks{"\x89PNG\r\n\x1A\n"sv,
                                                         "\xFF\xD8\xFF"sv,
                                                         "BM"sv,
                                                         "II*\0"sv,
                                                         "MM\0*"sv,
                                                         "P1"sv,
                                                         "P2"sv,
                                                         "P3"sv,
                                                         "P4"sv,
                                                         "P5"sv,
                                                         "P6"sv,
                                                         "\x59\xA6\x6A\x95"sv,
                                                         "\xFF\x4F\xFF\x51"sv};

// DICOM is identified at byte 128, independently of the first bytes. If OpenCV's decoder for those
// rejects the file ("P4" and no blank), GDCM would read it.
bool IsDicom(std::string_view bytes) {
  return bytes.size() >= 132 && bytes.substr(128, 4) == "DICM";
}

bool IsPicture(std::string_view bytes) {
  if (IsDicom(bytes)) return false;
  const auto starts = [bytes](std::string_view mark) { return bytes.starts_with(mark); };
  return std::ranges::any_of(kPictureMarks, starts) ||
         bytes.starts_with("\0\0\0\x0CjP  \r\n\x87\n"sv) ||
         (bytes.starts_with("RIFF") && bytes.substr(0, 12).ends_with("WEBP"));
}

}  // namespace

cv::Mat ReadImage(const std::filesystem::path& file, int flags) {
  constexpr std::uint64_t kMaxBytes = INT_MAX;  // OpenCV's
  std::string bytes = ReadBytes(file, kMaxBytes);
  if (bytes.empty()) ThrowError("cannot decode {}: the file is empty", file.string());
  if (!IsPicture(bytes)) {
    ThrowError(
        "cannot decode {}: it is not a PNG, JPEG, TIFF, BMP, PNM, WebP, JPEG 2000 or Sun raster "
        "file",
        file.string());
  }
  cv::Mat picture;
  if (!IsCutJpeg(bytes)) {
    try {
      picture = cv::imdecode(cv::Mat(1, static_cast<int>(bytes.size()), CV_8UC1, bytes.data()),
                             flags | cv::IMREAD_IGNORE_ORIENTATION);
    } catch (const cv::Exception& e) {
      const bool too_large = e.err.find("CV_IO_MAX_IMAGE") != std::string::npos;
      ThrowError("cannot decode {}: {}",
                 file.string(),
                 too_large ? "it has more pixels than OpenCV reads, 2^30" : e.err);
    }
  }
  if (picture.empty()) {
    ThrowError("cannot decode {}: it is damaged, truncated or of a kind that OpenCV does not read",
               file.string());
  }
  return picture;
}

}  // namespace cohort
