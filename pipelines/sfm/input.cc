#include "pipelines/sfm/input.h"

#include <algorithm>
#include <vector>

#include "datasets/readers/gray_image.h"
#include "frontend/geometry/camera_text.h"
#include "frontend/image/read_image.h"
#include "pipelines/sfm/fingerprint.h"

namespace cohort {
namespace {

Camera ParseCamera(const std::string& text, int width_px, int height_px) {
  std::vector<std::string> words;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t comma = std::min(text.find(',', at), text.size());
    words.push_back(text.substr(at, comma - at));
    at = comma + 1;
  }
  try {
    Camera camera = CameraFromWords(words);
    camera.width_px = width_px;
    camera.height_px = height_px;
    return camera;
  } catch (const Error& error) {
    ThrowUsageError("--camera '{}': {}", text, error.what());
  }
}

}  // namespace

std::string DoubtOfCamera(const std::optional<Camera>& camera) {
  if (!camera) return "";
  // No lens does that, decimals with a comma do: 525,5 525,5 ...
  if (camera->fx > 2.0 * camera->fy || camera->fy > 2.0 * camera->fx) {
    return fmt::format(
        "the camera's focal lengths {:g} and {:g} px are of no lens: is the calibration right, and "
        "are its decimals with points?",
        camera->fx,
        camera->fy);
  }
  const bool is_inside = camera->cx >= 0.0 && camera->cy >= 0.0 && camera->cx < camera->width_px &&
                         camera->cy < camera->height_px;
  if (is_inside) return "";
  return fmt::format(
      "the camera's principal point ({:g}, {:g}) lies outside its pictures of {} x {}: is the "
      "calibration of pictures of another size?",
      camera->cx,
      camera->cy,
      camera->width_px,
      camera->height_px);
}

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
  const std::string fingerprint = FingerprintOfFrames(sequence);
  if (!fingerprint.empty()) file.meta["fingerprint"] = fingerprint;
  file.camera = KnownCamera(options, sequence, file.width_px, file.height_px);
}

std::string AbsolutePath(const std::filesystem::path& path) {
  return path.empty() ? "" : std::filesystem::absolute(path).lexically_normal().string();
}

cv::Mat ReadMask(const std::string& path) {
  if (path.empty()) return {};
  try {
    return ReadImage(path, cv::IMREAD_GRAYSCALE);
  } catch (const Error& error) {
    ThrowError("cannot read the mask {}: give a picture ({})", path, error.what());
  }
}

}  // namespace cohort
