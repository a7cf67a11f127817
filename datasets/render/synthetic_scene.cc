#include "datasets/render/synthetic_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <mutex>
#include <nlohmann/json.hpp>

#include "datasets/readers/tum_writer.h"
#include "datasets/render/render.h"
#include "datasets/render/scene_geometry.h"
#include "frontend/core/error.h"
#include "frontend/core/json_text.h"
#include "frontend/core/parallel.h"
#include "frontend/storage/input_file.h"
#include "frontend/storage/output.h"

namespace cohort {
namespace {

// Increase it when the same options give another scene.
constexpr int kSceneVersion = 2;
constexpr std::int64_t kFramesPerSecond = 30;

template <typename Enum, std::size_t N>
Enum ChoiceNamed(const ChoiceNames<Enum, N>& names, const std::string& text) {
  if (const auto value = ValueOf(names, text)) return *value;
  ThrowError("'{}' is unknown", text);
}

int Integer(const nlohmann::json& file, const char* key) {
  const nlohmann::json& value = file.at(key);
  // Converted to a wide number first, because get<int> would truncate it.
  const auto wide = value.is_number_integer() ? value.get<double>() : -1e300;
  if (!(std::abs(wide) <= std::numeric_limits<int>::max())) ThrowError("{} is not a count", key);
  return static_cast<int>(wide);
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
    record.timestamp_ns = static_cast<std::int64_t>(i) * 1'000'000'000 / kFramesPerSecond;
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
      options.seed,  // as text: JSON in other programs has numbers of 53 bits
      first_frame,
      frame_step);
}

int SceneFile::FrameOf(FrameIndex i) const {
  const std::int64_t frame = first_frame + std::int64_t{ToInt(i)} * frame_step;
  if (frame > kMostFrame) {
    ThrowError(
        "frame {} of the clip is frame {} of its scene, but {} is the last: check that scene.json "
        "belongs to the clip",
        ToInt(i),
        frame,
        kMostFrame);
  }
  return static_cast<int>(frame);
}

std::optional<SceneFile> ReadSceneFile(const std::filesystem::path& folder) {
  const std::filesystem::path path = folder / "scene.json";
  if (!std::filesystem::exists(path)) return std::nullopt;
  constexpr std::uint64_t kMaxBytes = 1 << 16;
  try {
    const auto file = ParseWithoutTwins<nlohmann::json>(ReadBytes(path, kMaxBytes));
    if (const int version = Integer(file, "version"); version != kSceneVersion) {
      ThrowError(
          "it has version {}, but this renderer has version {}: render the scene again, or use the "
          "version of cohort that rendered it",
          version,
          kSceneVersion);
    }
    SceneFile scene;
    scene.options.scene = ChoiceNamed(kSceneNames, file.at("scene").get<std::string>());
    scene.options.motion = ChoiceNamed(kMotionNames, file.at("motion").get<std::string>());
    scene.options.frames = Integer(file, "frames");
    scene.options.width_px = Integer(file, "width_px");
    scene.options.height_px = Integer(file, "height_px");
    scene.options.focal_px = file.at("focal_px").get<double>();
    scene.options.readout = file.value("readout", 0.0);  // missing: a global shutter
    const auto seed = file.at("seed").get<std::string>();
    const char* const end = seed.data() + seed.size();
    const auto [stop, fault] = std::from_chars(seed.data(), end, scene.options.seed);
    if (fault != std::errc() || stop != end) {
      ThrowError("seed '{}' is not a number", seed);
    }
    scene.first_frame = Integer(file, "first_frame");
    scene.frame_step = Integer(file, "frame_step");
    ValidateOptions(scene.options);
    if (scene.first_frame < 0 || scene.frame_step < 1) ThrowError("its frames are out of order");
    if (std::max(scene.first_frame, scene.frame_step) > SceneFile::kMostFrame) {
      ThrowError("first_frame {} or frame_step {} is beyond {}",
                 scene.first_frame,
                 scene.frame_step,
                 SceneFile::kMostFrame);
    }
    return scene;
  } catch (const nlohmann::json::parse_error& e) {
    ThrowError("cannot use {}: it is not valid JSON (byte {})", path.string(), e.byte);
  } catch (const std::exception& e) {
    ThrowError("cannot use {}: {}", path.string(), e.what());
  }
}

}  // namespace cohort
