#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>

namespace cohort {

// The pixels of an image file as stored, or as converted by other OpenCV flags. EXIF orientation is
// always ignored, as in COLMAP. The first bytes determine the format: PNG, JPEG, TIFF, BMP, PNM,
// WebP, JPEG 2000 and Sun raster are read. Throws Error if the file is missing, unreadable,
// truncated, of another format or of more than 2^30 pixels.
cv::Mat ReadImage(const std::filesystem::path& file, int flags = cv::IMREAD_UNCHANGED);

}  // namespace cohort
