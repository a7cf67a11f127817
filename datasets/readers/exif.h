#pragma once

#include <filesystem>
#include <optional>

namespace cohort {

// The focal length entries of EXIF (CIPA DC-008, 4.6.5); all above 0.
struct ExifFocal {
  std::optional<double> in_35mm_film_mm;  // FocalLengthIn35mmFilm
  std::optional<double> mm;               // FocalLength
  // FocalPlaneXResolution: pixels of the original picture per mm of the sensor.
  std::optional<double> pixels_per_mm;
  // The longer side of the original picture (PixelXDimension, PixelYDimension); this one may be
  // smaller.
  std::optional<double> long_side_px;
};

// Reads a JPEG, a PNG or a TIFF. Missing or damaged entries are left out and never an error.
ExifFocal ReadExifFocal(const std::filesystem::path& picture);

}  // namespace cohort
