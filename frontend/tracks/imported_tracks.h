#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>

#include "frontend/geometry/camera.h"
#include "frontend/tracks/track_set.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// What a file of another program says of a clip.
struct ImportedTracks {
  TrackSet tracks;
  std::optional<Camera> camera;    // where the file has one
  std::size_t unknown_images = 0;  // with positions, and no frame of the clip
  std::string an_unknown_image;
  std::size_t left_out = 0;  // positions, for the reason that the reader states
};

// Whether a position is of the picture, to the rims of its outermost pixels.
inline bool IsInPicture(const Eigen::Vector2d& xy, int width_px, int height_px) {
  return xy.x() >= -0.5 && xy.y() >= -0.5 && xy.x() <= width_px - 0.5 && xy.y() <= height_px - 0.5;
}

// Frames by the names of their pictures: the name itself, else the only frame whose name has the same
// last part (`images/0001.png`, `0001.png`), else the only one that has it but for the extension.
// Throws Error where two names are of one frame.
class FrameNames {
 public:
  explicit FrameNames(std::span<const FrameInfo> frames);
  std::optional<FrameIndex> Find(const std::string& name);

 private:
  // None: two frames have it.
  using ByName = std::map<std::string, std::optional<FrameIndex>>;
  ByName by_name_;
  ByName by_last_part_;
  ByName by_stem_;
  std::map<FrameIndex, std::string> found_;
};

// Throws Error where nothing of `path` is of the clip.
void CheckSomeImageKnown(const ImportedTracks& imported,
                         const std::string& path,
                         std::span<const FrameInfo> frames);

}  // namespace cohort
