#include "datasets/synthetic_scene.h"

#include <mutex>
#include <nlohmann/json.hpp>

#include "datasets/parallel.h"
#include "datasets/render.h"
#include "datasets/scene_geometry.h"
#include "datasets/tum_writer.h"
#include "frontend/core/error.h"
#include "frontend/core/output.h"

namespace cohort {
namespace {

constexpr int kSceneVersion = 1;  // raise it when the same options give another scene
constexpr std::int64_t kFps = 30;

template <typename Enum, std::size_t N>
Enum ValueOf(const ChoiceNames<Enum, N>& names, const std::string& text) {
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
    record.depth_m = renderer.RenderDepth(frame);
    record.cam_from_world = scene.CamFromWorld(frame);
    writer.Write(i, record);
    const std::lock_guard lock(mutex);
    if (progress) progress(++done, frames);
  });
  writer.Finish();
}

std::string SceneFile::Text() const {
  const nlohmann::ordered_json json{{"kind", "cohort synthetic scene"},
                                    {"version", kSceneVersion},
                                    {"scene", NameOf(kSceneNames, options.scene)},
                                    {"motion", NameOf(kMotionNames, options.motion)},
                                    {"frames", options.frames},
                                    {"width_px", options.width_px},
                                    {"height_px", options.height_px},
                                    {"focal_px", options.focal_px},
                                    {"seed", options.seed},
                                    {"first_frame", first_frame},
                                    {"frame_step", frame_step}};
  return json.dump(2) + "\n";
}

std::optional<SceneFile> ReadSceneFile(const std::filesystem::path& folder) {
  const std::filesystem::path file = folder / "scene.json";
  if (!std::filesystem::exists(file)) return std::nullopt;
  try {
    const nlohmann::json json = nlohmann::json::parse(ReadBytes(file));
    if (const int version = json.at("version"); version != kSceneVersion) {
      ThrowError("it is of version {}, this renderer is {}: render the scene again",
                 version,
                 kSceneVersion);
    }
    SceneFile scene;
    scene.options.scene = ValueOf(kSceneNames, json.at("scene"));
    scene.options.motion = ValueOf(kMotionNames, json.at("motion"));
    scene.options.frames = json.at("frames");
    scene.options.width_px = json.at("width_px");
    scene.options.height_px = json.at("height_px");
    scene.options.focal_px = json.at("focal_px");
    scene.options.seed = json.at("seed");
    scene.first_frame = json.at("first_frame");
    scene.frame_step = json.at("frame_step");
    ValidateOptions(scene.options);
    return scene;
  } catch (const std::exception& e) {
    ThrowError("cannot use {}: {}", file.string(), e.what());
  }
}

}  // namespace cohort
