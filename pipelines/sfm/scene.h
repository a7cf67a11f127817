#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <vector>

#include "backend/scene/reconstruction.h"
#include "datasets/readers/sequence.h"
#include "frontend/core/options.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/sfm/progress.h"

namespace cohort {

// Options of a scene: a folder that radiance field programs open.
struct SceneOptions {
  int max_images = 300;
  double min_motion = 0.01;
  int points = 20000;
  bool brighten = false;
  int jpeg_quality = 95;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("max_images",
             o.max_images,
             2,
             1000000,
             "The maximum number of pictures in the scene; all frames keep their poses in model/. "
             "More pictures give a finer scene that takes longer to train.",
             Tier::kCommon);
    v.Number("min_motion",
             o.min_motion,
             0.0,
             1.0,
             "The minimum motion from one picture of the scene to the next, as a share of the "
             "picture's diagonal; of the frames in between, the sharpest is taken. 0: all frames.",
             Tier::kCommon);
    v.Number(
        "points",
        o.points,
        0,
        1000000,
        "The maximum number of points that the scene has in addition to those of the tracks, as "
        "a start for Gaussian splatting. More points are a better start; the time of this "
        "stage grows in proportion. 0: none.",
        Tier::kCommon);
    v.Flag(
        "brighten",
        o.brighten,
        "Brighten all pictures and colours of the scene by the same curve, so that a dark clip "
        "becomes visible and trains better. Tracks and model are made from the original pictures.",
        Tier::kCommon);
    v.Number("jpeg_quality", o.jpeg_quality, 1, 100, "JPEG quality of the scene's pictures");
  }
};

// A candidate frame for a picture of the scene.
struct SceneCandidate {
  FrameIndex frame{};
  double motion = 0.0;     // since the previous candidate, as a share of the picture's diagonal
  double sharpness = 0.0;  // mean square gradient; comparable among neighbours only
};

// Splits the camera's path into equal pieces of at least `min_motion` (or 50 shorter ones), at most
// `max_images`, and takes the sharpest frame of each. Ascending.
std::vector<FrameIndex> ChooseImages(const std::vector<SceneCandidate>& candidates,
                                     const SceneOptions& options);

// The pinhole camera of the same size, with fx = fy and a centred principal point, that sees as
// much as possible of what `camera` sees, and nothing else: its pictures have no blank border.
Camera UndistortedCamera(const Camera& camera);

// The rigid motion that moves the mean of the cameras to the origin and their mean upward direction
// to +z, as viewers expect.
Rigid3 SceneFromModel(const Reconstruction& model);

// The outputs of WriteScene.
inline constexpr std::array<const char*, 5> kSceneOutputs{
    "images", "masks", "sparse", "sparse_pc.ply", "transforms.json"};

// Throws Error if WriteScene would replace contents of a folder that do not belong to a scene of
// cohort: files of those names with neither clip.tracks nor model_of.json, other pictures, or the
// clip itself.
void CheckSceneFolder(const std::filesystem::path& folder);
// Removes only what WriteScene wrote there.
void RemoveScene(const std::filesystem::path& folder);

// v -> ((v - black) / (white - black))^gamma, for intensities 0..1, clipped.
struct ToneCurve {
  double black = 0.0;
  double white = 1.0;
  double gamma = 1.0;

  double operator()(double value) const;
};

// Mean intensity 0..1 of each of the file's frames, for a run that writes no scene. `sequence`: the
// clip, rewound here.
std::vector<double> BrightnessOfFrames(const TrackFile& file,
                                       Sequence& sequence,
                                       const StageProgress& progress = {});

struct SceneFigures {
  std::vector<FrameIndex> images;
  std::size_t points = 0;
  std::size_t points_added = 0;  // of these (FurtherPoints)
  Camera camera;
  FocalScales focal_scale;  // of the pictures, if the model's focal length changes
  Rigid3 scene_from_model;  // times `scale`
  double scale = 1.0;
  std::optional<ToneCurve> tone;
  bool masked = false;  // whether a picture has a mask: then all have one
  // Mean intensity 0..1 of every frame of the tracks, ascending.
  std::vector<double> brightness;
};

// Writes images/, sparse/0/, transforms.json and sparse_pc.ply (docs/files.md), and masks/ if
// frames have masks, into an existing folder, each whole or not at all. `sequence`: the clip,
// rewound here and read twice, frame by frame. The scene has the model's points, and up to
// options.points others, followed through its pictures (FurtherPoints). Throws Error if clip and
// model do not belong together.
SceneFigures WriteScene(const TrackFile& file,
                        const Reconstruction& model,
                        Sequence& sequence,
                        const SceneOptions& options,
                        const std::filesystem::path& folder,
                        const StageProgress& progress = {});

}  // namespace cohort
