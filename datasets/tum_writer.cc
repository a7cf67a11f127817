#include "datasets/tum_writer.h"

#include <fmt/format.h>

#include <opencv2/imgcodecs.hpp>

#include "frontend/core/error.h"

namespace cohort {
namespace {

std::string Seconds(std::int64_t timestamp_ns) {
  return fmt::format("{}.{:09}", timestamp_ns / 1'000'000'000, timestamp_ns % 1'000'000'000);
}

}  // namespace

TumWriter::TumWriter(const std::filesystem::path& folder)
    : folder_(folder,
              {"rgb",
               "depth",
               "occluder",
               "rgb.txt",
               "depth.txt",
               "occluder.txt",
               "calibration.txt",
               "groundtruth.txt",
               "scene.json"}) {}

void TumWriter::WriteCamera(const Camera& c) {
  std::string text = fmt::format("{} {} {} {}", c.fx, c.fy, c.cx, c.cy);
  if (c.HasDistortion()) text += fmt::format(" {} {} {} {}", c.k1, c.k2, c.p1, c.p2);
  AddFile("calibration.txt", text + "\n");
}

void TumWriter::AddPicture(const char* kind,
                           const cv::Mat& picture,
                           std::int64_t timestamp_ns,
                           std::string& list) {
  const std::size_t index = kind[0] == 'r' ? 0 : kind[0] == 'd' ? 1 : 2;
  const std::string name = fmt::format("{}/{:06}.png", kind, pictures_[index]++);
  const std::filesystem::path path = folder_.partial() / name;
  if (pictures_[index] == 1) std::filesystem::create_directory(path.parent_path());
  std::vector<std::uint8_t> bytes;
  cv::imencode(".png", picture, bytes, {cv::IMWRITE_PNG_COMPRESSION, 1});
  WriteBytes(path, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
  list += fmt::format("{} {}\n", Seconds(timestamp_ns), name);
}

void TumWriter::AddFrame(const cv::Mat& picture, std::int64_t timestamp_ns) {
  AddPicture("rgb", picture, timestamp_ns, frames_);
}

void TumWriter::AddDepth(const cv::Mat& depth_m, std::int64_t timestamp_ns) {
  Check(depth_m.type() == CV_32FC1, "depth is CV_32FC1");
  cv::Mat units;
  depth_m.convertTo(units, CV_16U, 5000.0);
  units.setTo(0, depth_m > 65535.0 / 5000.0);  // beyond 13.1 m: unknown
  AddPicture("depth", units, timestamp_ns, depths_);
}

void TumWriter::AddOccluder(const cv::Mat& mask, std::int64_t timestamp_ns) {
  AddPicture("occluder", mask, timestamp_ns, occluders_);
}

void TumWriter::AddPose(const Rigid3& cam_from_world, std::int64_t timestamp_ns) {
  const Rigid3 p = cam_from_world.Inverse();
  poses_ += fmt::format("{} {:.12g} {:.12g} {:.12g} {:.12g} {:.12g} {:.12g} {:.12g}\n",
                        Seconds(timestamp_ns),
                        p.translation.x(),
                        p.translation.y(),
                        p.translation.z(),
                        p.rotation.x(),
                        p.rotation.y(),
                        p.rotation.z(),
                        p.rotation.w());
}

void TumWriter::AddFile(const std::string& name, const std::string& text) {
  WriteBytes(folder_.partial() / name, text);
}

void TumWriter::Finish() {
  AddFile("rgb.txt", frames_);
  if (!depths_.empty()) AddFile("depth.txt", depths_);
  if (!occluders_.empty()) AddFile("occluder.txt", occluders_);
  if (!poses_.empty()) AddFile("groundtruth.txt", poses_);
  folder_.Commit();
}

}  // namespace cohort
