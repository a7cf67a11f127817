#pragma once

#include <filesystem>
#include <optional>

namespace cohort {

// What EXIF says of the focal length (CIPA DC-008, 4.6.5); all above 0.
struct ExifFocal {
  std::optional<double> in_35mm_film_mm;  // FocalLengthIn35mmFilm
  std::optional<double> mm;               // FocalLength
  // FocalPlaneXResolution: pixels of the picture that the camera wrote, per mm of the sensor.
  std::optional<double> pixels_per_mm;
  // The longer side of that picture (PixelXDimension, PixelYDimension): this one may be smaller.
  std::optional<double> long_side_px;
};

// Of a JPEG, a PNG or a TIFF. What is missing or damaged is left out: no file is refused for it.
ExifFocal ReadExifFocal(const std::filesystem::path& picture);

}  // namespace cohort
