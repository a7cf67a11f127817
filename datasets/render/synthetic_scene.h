#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "frontend/core/options.h"
#include "frontend/tracks/observation.h"

namespace cohort {

enum class SceneName { kRoom, kCorridor, kStreet, kTabletop, kFacade, kShelves, kBodies, kCloth };
inline constexpr ChoiceNames<SceneName, 8> kSceneNames{{{"room", SceneName::kRoom},
                                                        {"corridor", SceneName::kCorridor},
                                                        {"street", SceneName::kStreet},
                                                        {"tabletop", SceneName::kTabletop},
                                                        {"facade", SceneName::kFacade},
                                                        {"shelves", SceneName::kShelves},
                                                        {"bodies", SceneName::kBodies},
                                                        {"cloth", SceneName::kCloth}}};

enum class Motion { kLateral, kForward, kOrbit };
inline constexpr ChoiceNames<Motion, 3> kMotionNames{
    {{"lateral", Motion::kLateral}, {"forward", Motion::kForward}, {"orbit", Motion::kOrbit}}};

struct SyntheticSceneOptions {
  SceneName scene = SceneName::kRoom;
  Motion motion = Motion::kLateral;
  int frames = 120;
  int width_px = 640;
  int height_px = 480;
  double focal_px = 525.0;
  double readout = 0.0;  // rolling shutter: share of the time between frames, first row to last
  unsigned seed = 1;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Choice("scene",
             o.scene,
             kSceneNames,
             "The scene to render: in bodies several boxes move, in cloth one surface deforms; the "
             "others are rigid.",
             Tier::kCommon);
    v.Choice(
        "motion", o.motion, kMotionNames, "The motion of the hand-held camera.", Tier::kCommon);
    v.Number("frames",
             o.frames,
             1,
             100000,
             "The number of frames to render, at 30 frames per second.",
             Tier::kCommon);
    v.Number("width_px", o.width_px, 64, 8192, "The width of the pictures [px].", Tier::kCommon);
    v.Number("height_px", o.height_px, 64, 8192, "The height of the pictures [px].", Tier::kCommon);
    v.Number("focal_px",
             o.focal_px,
             50.0,
             20000.0,
             "The focal length [px]; a longer one shows less of the scene, but larger.",
             Tier::kCommon);
    v.Number("readout",
             o.readout,
             0.0,
             1.0,
             "The readout of a rolling shutter: the time from the first row's exposure to the last "
             "one's, as a share of the time between frames, about 0.5 to 0.9 for phones. The true "
             "pose of a frame is that of its middle row. 0: a global shutter.",
             Tier::kCommon);
    v.Number("seed",
             o.seed,
             0U,
             4294967295U,
             "The seed of the layout, the textures and the camera shake; another seed gives "
             "another clip.",
             Tier::kCommon);
  }
};

// Called after each finished frame with the number done and the total (0: unknown).
using Progress = std::function<void(std::size_t done, std::size_t total)>;

// Renders a clip into a folder in TUM layout with exact ground truth: rgb/, depth/ (to 13.1 m),
// calibration.txt, groundtruth.txt, and scene.json, from which track_truth.h rebuilds the scene.
// With a rolling shutter (`readout`) poses and time stamps are the middle row's, and each row of a
// depth picture has its own camera. Whole or not at all; the bytes do not depend on `threads` (0:
// one per core).
void RenderSequence(const SyntheticSceneOptions& options,
                    const std::filesystem::path& out,
                    const Progress& progress = {},
                    unsigned threads = 0);

// scene.json: the scene of a clip, and which of its frames the clip has.
struct SceneFile {
  SyntheticSceneOptions options;
  int first_frame = 0;  // frame i of the clip is frame first_frame + i * frame_step of the scene
  int frame_step = 1;

  static constexpr int kMostFrame = 10'000'000;  // of the scene: four days of it

  // The scene's frame for frame i of the clip. Throws Error beyond kMostFrame.
  int FrameOf(FrameIndex i) const;
  std::string Text() const;
};
// Reads a folder's file; nullopt if there is no scene.json. Throws Error if it is invalid or from
// another version of the renderer.
std::optional<SceneFile> ReadSceneFile(const std::filesystem::path& folder);

}  // namespace cohort
