#include "tests/datasets/fixtures.h"

#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <stdexcept>

#include "datasets/readers/tum_writer.h"
#include "datasets/render/render.h"
#include "datasets/render/scene_geometry.h"
#include "tests/support/closed_form_image.h"

namespace cohort::test {

namespace fs = std::filesystem;

void WriteImage(const fs::path& file, int value, cv::Size size) {
  fs::create_directories(file.parent_path());
  if (!cv::imwrite(file.string(), cv::Mat(size, CV_8UC1, cv::Scalar(value)))) {
    throw std::runtime_error("cannot write " + file.string());
  }
}

void WriteText(const fs::path& file, const std::string& text) {
  fs::create_directories(file.parent_path());
  std::ofstream stream(file, std::ios::binary);
  stream << text;
  if (!stream) throw std::runtime_error("cannot write " + file.string());
}

void CutFile(const fs::path& file, double fraction) {
  const auto size = static_cast<double>(fs::file_size(file));
  fs::resize_file(file, static_cast<std::uintmax_t>(fraction * size));
}

void WriteSceneWithoutPictures(const SyntheticSceneOptions& options, const fs::path& folder) {
  const SyntheticScene scene(options);
  TumWriter writer(folder);
  writer.WriteCamera(scene.camera());
  writer.WriteFile("scene.json", SceneFile{options}.Text());
  for (int frame = 0; frame < options.frames; ++frame) {
    TumWriter::Record record;
    record.timestamp_ns = 33'333'333 * static_cast<std::int64_t>(frame);
    record.picture = WavesImage(options.width_px, options.height_px, 2.0 * frame, 0.0);
    record.depth_m = RenderDepth(scene, frame);
    record.cam_from_world = scene.CamFromWorld(frame);
    writer.Write(static_cast<std::size_t>(frame), record);
  }
  writer.Finish();
}

std::vector<Frame> ReadAll(Sequence& sequence) {
  std::vector<Frame> frames;
  while (auto frame = sequence.Next()) frames.push_back(*frame);
  return frames;
}

std::vector<std::string> Names(const std::vector<Frame>& frames) {
  std::vector<std::string> names;
  for (const Frame& frame : frames) names.push_back(frame.name);
  return names;
}

std::vector<std::uint32_t> Indices(const std::vector<Frame>& frames) {
  std::vector<std::uint32_t> indices;
  for (const Frame& frame : frames) indices.push_back(ToInt(frame.index));
  return indices;
}

}  // namespace cohort::test
