#include "pipelines/sfm/input.h"

#include <array>
#include <charconv>
#include <cmath>
#include <opencv2/imgcodecs.hpp>

namespace cohort {
namespace {

Camera ParseCamera(const std::string& text, int width_px, int height_px) {
  std::array<double, 8> values{};
  std::size_t count = 0;
  const char* at = text.data();
  const char* const end = at + text.size();
  while (count < values.size()) {
    const auto [stop, error] = std::from_chars(at, end, values[count]);
    if (error != std::errc() || !std::isfinite(values[count])) break;
    ++count;
    at = stop;
    if (at == end || *at != ',') break;
    ++at;
  }
  if (at != end || (count != 4 && count != 8)) {
    ThrowUsageError("--camera '{}' is no camera: give fx,fy,cx,cy or fx,fy,cx,cy,k1,k2,p1,p2",
                    text);
  }
  if (!(values[0] > 0.0 && values[1] > 0.0)) {
    ThrowUsageError("--camera '{}': fx and fy must be above 0", text);
  }
  return {.width_px = width_px,
          .height_px = height_px,
          .fx = values[0],
          .fy = values[1],
          .cx = values[2],
          .cy = values[3],
          .k1 = values[4],
          .k2 = values[5],
          .p1 = values[6],
          .p2 = values[7]};
}

}  // namespace

std::unique_ptr<Sequence> OpenInput(const InputOptions& options) {
  return OpenSequence(options.input,
                      options.layout,
                      options.frames.empty() ? FrameRange{} : FrameRange::Parse(options.frames));
}

std::optional<Camera> KnownCamera(const InputOptions& options,
                                  const Sequence& sequence,
                                  int width_px,
                                  int height_px) {
  if (!options.camera.empty()) return ParseCamera(options.camera, width_px, height_px);
  return sequence.KnownCamera();
}

void DescribeInput(const InputOptions& options, const Sequence& sequence, TrackFile& file) {
  file.source = AbsolutePath(options.input);
  file.image_root = AbsolutePath(sequence.ImageRoot());
  file.camera = KnownCamera(options, sequence, file.width_px, file.height_px);
}

std::string AbsolutePath(const std::filesystem::path& path) {
  return path.empty() ? "" : std::filesystem::absolute(path).lexically_normal().string();
}

cv::Mat ReadMask(const std::string& path) {
  if (path.empty()) return {};
  cv::Mat mask = cv::imread(path, cv::IMREAD_GRAYSCALE);
  if (mask.empty()) ThrowError("cannot read the mask {}: give a picture", path);
  return mask;
}

}  // namespace cohort
