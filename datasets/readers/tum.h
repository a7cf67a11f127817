#pragma once

#include <filesystem>

#include "datasets/readers/image_list.h"

namespace cohort {

inline constexpr char kTumMark[] = "rgb.txt";
bool IsTum(const std::filesystem::path& folder);

// A folder in the layout of TUM RGB-D and ETH3D-SLAM. Lines are `timestamp [s] path`:
//   rgb.txt          the images
//   calibration.txt  fx fy cx cy [px] and distortion, as in camera_text.h           (optional)
//   groundtruth.txt  timestamp tx ty tz qx qy qz qw: world_from_cam [m]             (optional)
//   depth.txt        16-bit PNGs, 1/5000 m, registered to the images; 0 is unknown  (optional)
//   occluder.txt     masks that `degrade` writes, not 0 where the scene is covered  (optional)
ImageList ReadTum(const std::filesystem::path& folder);

}  // namespace cohort
