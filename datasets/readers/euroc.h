#pragma once

#include <filesystem>

#include "datasets/readers/image_list.h"

namespace cohort {

inline constexpr char kEurocMark[] = "mav0/cam0/data.csv";
bool IsEuroc(const std::filesystem::path& folder);

// A folder in the ASL layout of EuRoC MAV, or its mav0; the left camera is read.
//   mav0/cam0/data.csv     timestamp [ns], file in mav0/cam0/data
//   mav0/cam0/sensor.yaml  resolution, intrinsics, distortion, T_BS = body_from_cam   (optional)
//   mav0/state_groundtruth_estimate0/data.csv
//                          timestamp [ns], world_from_body as x y z [m] qw qx qy qz   (optional)
// cam_from_world = (world_from_body * body_from_cam)^-1, so truth needs sensor.yaml.
ImageList ReadEuroc(const std::filesystem::path& folder);

}  // namespace cohort
