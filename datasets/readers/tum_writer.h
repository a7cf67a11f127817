#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <mutex>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>
#include <string_view>

#include "frontend/geometry/camera.h"
#include "frontend/geometry/rigid3.h"
#include "frontend/storage/output.h"

namespace cohort {

// Writes a sequence as ReadTum (tum.h) reads it, whole or not at all. Frames may come in any order
// and from several threads. Times are written to the nanosecond, poses exactly.
class TumWriter {
 public:
  struct Record {
    std::int64_t timestamp_ns = 0;
    cv::Mat picture;  // 8 or 16 bits
    std::optional<Rigid3> cam_from_world;
    std::optional<cv::Mat> depth_m;   // CV_32FC1; 0 or beyond 16 bits: unknown
    std::optional<cv::Mat> occluder;  // CV_8UC1, 255: covered
  };

  explicit TumWriter(const std::filesystem::path& folder);

  // The folder under construction until Finish, also for temporary files.
  const std::filesystem::path& partial() const { return folder_.partial(); }
  void WriteCamera(const Camera& camera);
  void WriteFile(const std::string& name, std::string_view text);
  void Write(std::size_t frame, const Record& record);
  void Finish();

 private:
  struct Lines {
    std::string rgb, depth, occluder, pose;
  };

  OutputFolder folder_;
  std::mutex mutex_;
  std::map<std::size_t, Lines> lines_;  // by frame
};

}  // namespace cohort
