#pragma once

#include <cstdint>
#include <filesystem>
#include <opencv2/core/mat.hpp>
#include <string>

#include "backend/geometry/camera.h"
#include "backend/geometry/rigid3.h"
#include "frontend/core/output.h"

namespace cohort {

// Writes a clip in TUM RGB-D layout, whole or not at all:
//   rgb.txt, depth.txt, occluder.txt   `seconds path`, lossless PNG; depth in 16 bits, 1/5000 m
//   calibration.txt                    fx fy cx cy [k1 k2 p1 p2]
//   groundtruth.txt                    `seconds tx ty tz qx qy qz qw`, world_from_cam
class TumWriter {
 public:
  explicit TumWriter(const std::filesystem::path& folder);

  void WriteCamera(const Camera& camera);
  void AddFrame(const cv::Mat& picture, std::int64_t timestamp_ns);  // 8 or 16 bits
  void AddPose(const Rigid3& cam_from_world, std::int64_t timestamp_ns);
  void AddDepth(const cv::Mat& depth_m, std::int64_t timestamp_ns);  // CV_32FC1, 0: unknown
  void AddOccluder(const cv::Mat& mask, std::int64_t timestamp_ns);  // CV_8UC1, 255: covered
  void AddFile(const std::string& name, const std::string& text);
  void Finish();

 private:
  void AddPicture(const char* kind,
                  const cv::Mat& picture,
                  std::int64_t timestamp_ns,
                  std::string& list);

  OutputFolder folder_;
  std::string frames_;
  std::string depths_;
  std::string occluders_;
  std::string poses_;
  std::size_t pictures_[3] = {0, 0, 0};
};

}  // namespace cohort
