#include "datasets/readers/exif.h"

#include <cstdint>
#include <map>
#include <sstream>
#include <string>
#include <string_view>

#include "datasets/readers/binary_source.h"
#include "frontend/core/error.h"
#include "frontend/storage/input_file.h"

namespace cohort {
namespace {

using std::string_view_literals::operator""sv;

constexpr std::uint16_t kExifIfd = 0x8769;
constexpr std::uint16_t kFocalLength = 0x920A;
constexpr std::uint16_t kPixelXDimension = 0xA002;
constexpr std::uint16_t kPixelYDimension = 0xA003;
constexpr std::uint16_t kFocalPlaneXResolution = 0xA20E;
constexpr std::uint16_t kFocalPlaneResolutionUnit = 0xA210;
constexpr std::uint16_t kFocalLengthIn35mmFilm = 0xA405;

// More than any camera writes; a file may claim any number.
constexpr std::uint64_t kMostTags = 1000;
constexpr int kMostSegments = 1 << 16;
constexpr std::uint64_t kMostExifBytes = 1 << 20;

// A directory of TIFF: the first value of each tag whose type is a number above 0.
class TiffDirectory {
 public:
  TiffDirectory(BinarySource& source, ByteOrder order, std::uint64_t offset) {
    const std::uint64_t count = source.Integer(offset, 2, order);
    for (std::uint64_t i = 0; i < count && i < kMostTags; ++i) {
      try {
        ReadEntry(source, order, offset + 2 + 12 * i);
      } catch (const Error&) {  // its value lies outside the file
      }
    }
  }

  std::optional<double> Find(std::uint16_t tag) const {
    const auto found = values_.find(tag);
    return found == values_.end() ? std::nullopt : std::optional(found->second);
  }

 private:
  void ReadEntry(BinarySource& source, ByteOrder order, std::uint64_t entry) {
    constexpr std::uint64_t kShort = 3;
    constexpr std::uint64_t kLong = 4;
    constexpr std::uint64_t kRational = 5;
    const auto tag = static_cast<std::uint16_t>(source.Integer(entry, 2, order));
    const std::uint64_t type = source.Integer(entry + 2, 2, order);
    if (source.Integer(entry + 4, 4, order) == 0) return;
    double value = 0.0;
    if (type == kShort) value = static_cast<double>(source.Integer(entry + 8, 2, order));
    if (type == kLong) value = static_cast<double>(source.Integer(entry + 8, 4, order));
    if (type == kRational) {
      const std::uint64_t at = source.Integer(entry + 8, 4, order);
      const std::uint64_t denominator = source.Integer(at + 4, 4, order);
      if (denominator == 0) return;
      value = static_cast<double>(source.Integer(at, 4, order)) / static_cast<double>(denominator);
    }
    if (value > 0.0) values_.emplace(tag, value);  // in EXIF, 0 means unknown
  }

  std::map<std::uint16_t, double> values_;
};

ExifFocal FocalOfTiff(BinarySource& source) {
  const std::string mark = source.Bytes(0, 4);
  if (mark != "II*\0"sv && mark != "MM\0*"sv) return {};
  const ByteOrder order = mark[0] == 'I' ? ByteOrder::kLittleEndian : ByteOrder::kBigEndian;
  const TiffDirectory first(source, order, source.Integer(4, 4, order));
  const auto place = first.Find(kExifIfd);
  if (!place) return {};
  const TiffDirectory exif(source, order, static_cast<std::uint64_t>(*place));
  ExifFocal focal;
  focal.in_35mm_film_mm = exif.Find(kFocalLengthIn35mmFilm);
  focal.mm = exif.Find(kFocalLength);
  if (const auto per_unit = exif.Find(kFocalPlaneXResolution)) {
    constexpr double kCentimetre = 3.0;
    constexpr double kMillimetre = 4.0;
    const double unit = exif.Find(kFocalPlaneResolutionUnit).value_or(2.0);  // inches
    const double unit_mm = unit == kCentimetre ? 10.0 : unit == kMillimetre ? 1.0 : 25.4;
    focal.pixels_per_mm = *per_unit / unit_mm;
  }
  for (const std::uint16_t side : {kPixelXDimension, kPixelYDimension}) {
    const auto px = exif.Find(side);
    if (px > focal.long_side_px) focal.long_side_px = px;
  }
  return focal;
}

ExifFocal FocalOfBytes(const std::string& tiff) {
  std::istringstream in(tiff);
  BinarySource source(in);
  return FocalOfTiff(source);
}

// Reads the segments before the coded picture: a marker, preceded by any number of FF, and a
// length.
ExifFocal FocalOfJpeg(BinarySource& source) {
  constexpr std::string_view kExif = "Exif\0\0"sv;
  std::uint64_t at = 2;
  for (int i = 0; i < kMostSegments; ++i) {
    if (source.Integer(at, 1) != 0xFF) return {};
    const std::uint64_t marker = source.Integer(at + 1, 1);
    if (marker == 0xFF) {
      ++at;
      continue;
    }
    if (marker == 0xDA || marker == 0xD9) return {};  // the picture, the end
    const std::uint64_t length = source.Integer(at + 2, 2);
    if (length < 2) return {};
    if (marker == 0xE1 && length >= 2 + kExif.size()) {
      const std::string segment = source.Bytes(at + 4, length - 2);
      if (segment.starts_with(kExif)) return FocalOfBytes(segment.substr(kExif.size()));
    }
    at += 2 + length;
  }
  return {};
}

// Reads chunks: a length, a name of four letters, that many bytes, and a checksum of four bytes.
ExifFocal FocalOfPng(BinarySource& source) {
  std::uint64_t at = 8;
  for (int i = 0; i < kMostSegments; ++i) {
    const std::uint64_t length = source.Integer(at, 4);
    const std::string name = source.Bytes(at + 4, 4);
    if (name == "IEND") return {};
    if (name == "eXIf") {
      return length <= kMostExifBytes ? FocalOfBytes(source.Bytes(at + 8, length)) : ExifFocal{};
    }
    at += 12 + length;
  }
  return {};
}

}  // namespace

ExifFocal ReadExifFocal(const std::filesystem::path& picture) {
  try {
    std::ifstream in = OpenInputFile(picture);
    BinarySource source(in);
    const std::string mark = source.Bytes(0, 8);
    if (mark.starts_with("\xFF\xD8\xFF")) return FocalOfJpeg(source);
    if (mark == "\x89PNG\r\n\x1A\n") return FocalOfPng(source);
    return FocalOfTiff(source);
  } catch (const Error&) {  // truncated, damaged or missing: reading its frame reports it
    return {};
  }
}

}  // namespace cohort
