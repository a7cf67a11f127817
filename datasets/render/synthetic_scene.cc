#include "datasets/render/synthetic_scene.h"

#include <fmt/format.h>

#include <charconv>
#include <mutex>
#include <opencv2/core/persistence.hpp>

#include "datasets/readers/tum_writer.h"
#include "datasets/render/render.h"
#include "datasets/render/scene_geometry.h"
#include "frontend/core/error.h"
#include "frontend/core/output.h"
#include "frontend/core/parallel.h"

namespace cohort {
namespace {

// Raise it when the same options give another scene.
constexpr int kSceneVersion = 2;
constexpr std::int64_t kFps = 30;

template <typename Enum, std::size_t N>
Enum ChoiceNamed(const ChoiceNames<Enum, N>& names, const std::string& text) {
  for (const auto& [name, value] : names) {
    if (name == text) return value;
  }
  ThrowError("'{}' is unknown", text);
}

}  // namespace

void RenderSequence(const SyntheticSceneOptions& options,
                    const std::filesystem::path& out,
                    const Progress& progress,
                    unsigned threads) {
  ValidateOptions(options);
  TumWriter writer(out);
  const SyntheticScene scene(options);
  const Renderer renderer(scene, threads);
  writer.WriteCamera(scene.camera());
  writer.WriteFile("scene.json", SceneFile{options}.Text());
  std::mutex mutex;
  std::size_t done = 0;
  const auto frames = static_cast<std::size_t>(options.frames);
  ParallelFor(frames, threads, [&](std::size_t i) {
    const auto frame = static_cast<double>(i);
    TumWriter::Record record;
    record.timestamp_ns = static_cast<std::int64_t>(i) * 1'000'000'000 / kFps;
    record.picture = renderer.RenderGray(frame);
    record.depth_m = RenderDepth(scene, frame);
    record.cam_from_world = scene.CamFromWorld(frame);
    writer.Write(i, record);
    const std::lock_guard lock(mutex);
    if (progress) progress(++done, frames);
  });
  writer.Finish();
}

std::string SceneFile::Text() const {
  return fmt::format(
      "{{\n"
      "  \"kind\": \"cohort synthetic scene\",\n"
      "  \"version\": {},\n"
      "  \"scene\": \"{}\",\n"
      "  \"motion\": \"{}\",\n"
      "  \"frames\": {},\n"
      "  \"width_px\": {},\n"
      "  \"height_px\": {},\n"
      "  \"focal_px\": {},\n"
      "{}"
      "  \"seed\": \"{}\",\n"
      "  \"first_frame\": {},\n"
      "  \"frame_step\": {}\n"
      "}}\n",
      kSceneVersion,
      NameOf(kSceneNames, options.scene),
      NameOf(kMotionNames, options.motion),
      options.frames,
      options.width_px,
      options.height_px,
      options.focal_px,
      options.readout > 0.0 ? fmt::format("  \"readout\": {},\n", options.readout) : "",
      options.seed,  // as text: cv::FileStorage reads integers of 31 bits
      first_frame,
      frame_step);
}

std::optional<SceneFile> ReadSceneFile(const std::filesystem::path& folder) {
  const std::filesystem::path path = folder / "scene.json";
  if (!std::filesystem::exists(path)) return std::nullopt;
  try {
    const cv::FileStorage file(path.string(), cv::FileStorage::READ);
    if (const auto version = static_cast<int>(file["version"]); version != kSceneVersion) {
      ThrowError("it is of version {}, this renderer of {}: render the scene again",
                 version,
                 kSceneVersion);
    }
    SceneFile scene;
    scene.options.scene = ChoiceNamed(kSceneNames, file["scene"].string());
    scene.options.motion = ChoiceNamed(kMotionNames, file["motion"].string());
    scene.options.frames = static_cast<int>(file["frames"]);
    scene.options.width_px = static_cast<int>(file["width_px"]);
    scene.options.height_px = static_cast<int>(file["height_px"]);
    scene.options.focal_px = static_cast<double>(file["focal_px"]);
    const cv::FileNode readout = file["readout"];  // not there: a global shutter
    if (!readout.empty()) scene.options.readout = static_cast<double>(readout);
    const std::string seed = file["seed"].string();
    if (std::from_chars(seed.data(), seed.data() + seed.size(), scene.options.seed).ec !=
        std::errc()) {
      ThrowError("seed '{}' is no number", seed);
    }
    scene.first_frame = static_cast<int>(file["first_frame"]);
    scene.frame_step = static_cast<int>(file["frame_step"]);
    ValidateOptions(scene.options);
    if (scene.first_frame < 0 || scene.frame_step < 1) ThrowError("its frames are out of order");
    return scene;
  } catch (const std::exception& e) {
    ThrowError("cannot use {}: {}", path.string(), e.what());
  }
}

}  // namespace cohort
