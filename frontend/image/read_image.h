#pragma once

#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>

namespace cohort {

// The pixels of an image file as stored, or as another of OpenCV's flags has them. EXIF orientation is
// ignored whatever the flags, as COLMAP does. The first bytes say what it is: PNG, JPEG, TIFF, BMP,
// PNM, WebP, JPEG 2000 and Sun raster are read. Throws Error if the file is missing, unreadable, cut
// short, none of these or one of more than 2^30 pixels.
cv::Mat ReadImage(const std::filesystem::path& file, int flags = cv::IMREAD_UNCHANGED);

}  // namespace cohort
