#pragma once

#include <filesystem>

#include "datasets/readers/image_list.h"

namespace cohort {

inline constexpr char kKittiMark[] = "image_0, image_l or image_2";
bool IsKitti(const std::filesystem::path& folder);

// A sequence folder of KITTI odometry. Its images are rectified.
//   image_0 or image_l (left grey), else image_2 (left colour): 000000.png ...
//   calib.txt   3x4 projection matrices P0, P1, ... a line each, with or without `P0:` (optional)
//   poses.txt   3x4 world_from_cam0 [m], row i is image i; also ../../poses/NAME.txt (optional)
//   times.txt   seconds, one a line; without it 10 frames a second (optional)
// P = K [I | t]: t moves the poses from camera 0 to the camera that is read.
ImageList ReadKitti(const std::filesystem::path& folder);

}  // namespace cohort
