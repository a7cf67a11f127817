#include "datasets/readers/tum_writer.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <vector>

#include "frontend/core/error.h"
#include "frontend/geometry/camera_text.h"
#include "frontend/image/write_image.h"

namespace cohort {
namespace {

constexpr double kUnitsPerMetre = 5000.0;
constexpr double kMaxDepthUnits = 65535.0;

std::string Seconds(std::int64_t timestamp_ns) {
  constexpr std::uint64_t kSecond = 1'000'000'000;
  // The quotient alone would lose the sign of -0.5, and the remainder would print it after the
  // point.
  const bool negative = timestamp_ns < 0;
  const auto ns = negative ? -static_cast<std::uint64_t>(timestamp_ns)
                           : static_cast<std::uint64_t>(timestamp_ns);
  return fmt::format("{}{}.{:09}", negative ? "-" : "", ns / kSecond, ns % kSecond);
}

void WritePng(const std::filesystem::path& file, const cv::Mat& picture) {
  WriteImage(file, picture, {cv::IMWRITE_PNG_COMPRESSION, 1});
}

cv::Mat DepthUnits(const cv::Mat& depth_m) {
  Check(depth_m.type() == CV_32FC1, "depth is CV_32FC1");
  cv::Mat units;
  depth_m.convertTo(units, CV_16U, kUnitsPerMetre);
  units.setTo(0, depth_m > kMaxDepthUnits / kUnitsPerMetre);
  return units;
}

void WriteFolder(const std::filesystem::path& folder) {
  std::error_code error;
  std::filesystem::create_directory(folder, error);
  if (error) ThrowError("cannot make folder {}: {}", folder.string(), error.message());
}

// Our pictures have numbers as names; those of the benchmark, and of other programs that write its
// layout, have times.
bool WasWrittenByUs(const std::filesystem::path& folder) {
  std::error_code none_there;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "rgb", none_there)) {
    const std::string name = entry.path().stem().string();
    return name.size() == 6 && name.find_first_not_of("0123456789") == std::string::npos;
  }
  return true;
}

}  // namespace

TumWriter::TumWriter(const std::filesystem::path& folder)
    : folder_(folder,
              {"rgb",
               "rgb.txt",
               "depth",
               "depth.txt",
               "occluder",
               "occluder.txt",
               "calibration.txt",
               "groundtruth.txt",
               "scene.json"},
              WasWrittenByUs) {}

void TumWriter::WriteCamera(const Camera& c) {
  WriteFile("calibration.txt", fmt::format("{}\n", fmt::join(WordsOfCamera(c), " ")));
}

void TumWriter::WriteFile(const std::string& name, std::string_view text) {
  WriteBytes(folder_.partial() / name, text);
}

void TumWriter::Write(std::size_t frame, const Record& record) {
  const std::string time = Seconds(record.timestamp_ns);
  Lines lines;
  const auto write_picture = [&](const char* kind, const cv::Mat& picture, std::string& line) {
    const std::string name = fmt::format("{}/{:06}.png", kind, frame);
    WriteFolder(folder_.partial() / kind);
    WritePng(folder_.partial() / name, picture);
    line = fmt::format("{} {}\n", time, name);
  };
  write_picture("rgb", record.picture, lines.rgb);
  if (record.depth_m) write_picture("depth", DepthUnits(*record.depth_m), lines.depth);
  if (record.occluder) write_picture("occluder", *record.occluder, lines.occluder);
  if (record.cam_from_world) {
    const Rigid3 world_from_cam = record.cam_from_world->Inverse();
    const Eigen::Vector3d& t = world_from_cam.translation;
    const Eigen::Quaterniond& q = world_from_cam.rotation;
    lines.pose = fmt::format(
        "{} {} {} {} {} {} {} {}\n", time, t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
  }
  const std::lock_guard lock(mutex_);
  lines_[frame] = std::move(lines);
}

void TumWriter::Finish() {
  Lines all;
  for (const auto& [frame, lines] : lines_) {
    all.rgb += lines.rgb;
    all.depth += lines.depth;
    all.occluder += lines.occluder;
    all.pose += lines.pose;
  }
  WriteFile("rgb.txt", all.rgb);
  if (!all.depth.empty()) WriteFile("depth.txt", all.depth);
  if (!all.occluder.empty()) WriteFile("occluder.txt", all.occluder);
  if (!all.pose.empty()) WriteFile("groundtruth.txt", all.pose);
  folder_.Commit();
}

}  // namespace cohort
