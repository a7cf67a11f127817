#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>

#include "frontend/geometry/camera.h"
#include "frontend/tracks/track_set.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// The tracks of a clip from another program's file.
struct ImportedTracks {
  TrackSet tracks;
  std::optional<Camera> camera;    // if the file has one
  std::size_t unknown_images = 0;  // images with positions that are not frames of the clip
  std::string an_unknown_image;
  std::size_t left_out = 0;     // positions, for the reason that the reader states
  bool fits_exchanged = false;  // ExtentOfTracks, before any was left out
};

// Whether a position lies in the picture, up to the outer edges of its pixels.
inline bool IsInPicture(const Eigen::Vector2d& xy, int width_px, int height_px) {
  return xy.x() >= -0.5 && xy.y() >= -0.5 && xy.x() <= width_px - 0.5 && xy.y() <= height_px - 0.5;
}

// Which of the positions lie outside the picture, as they are and with x and y exchanged.
struct ExtentOfTracks {
  std::size_t observed = 0;
  std::size_t outside = 0;
  std::size_t outside_exchanged = 0;
  std::size_t within_one = 0;  // between -1 and 1

  void Add(const Eigen::Vector2d& xy, int width_px, int height_px) {
    ++observed;
    if (!IsInPicture(xy, width_px, height_px)) ++outside;
    if (!IsInPicture({xy.y(), xy.x()}, width_px, height_px)) ++outside_exchanged;
    if (xy.lpNorm<Eigen::Infinity>() <= 1.1) ++within_one;
  }
  // Whether x and y are probably exchanged: some positions lie outside, and hardly any would.
  bool FitsExchanged() const { return 50 * outside > observed && 10 * outside_exchanged < outside; }
};

// Finds frames by the names of their pictures: by the name itself, else by the last part of the
// name if it is unique (`images/0001.png`, `0001.png`), else by the last part without its
// extension. Throws Error if two names refer to one frame.
class FrameNames {
 public:
  explicit FrameNames(std::span<const FrameInfo> frames);
  std::optional<FrameIndex> Find(const std::string& name);

 private:
  // nullopt: two frames have this name.
  using ByName = std::map<std::string, std::optional<FrameIndex>>;
  ByName by_name_;
  ByName by_last_part_;
  ByName by_stem_;
  std::map<FrameIndex, std::string> found_;
};

// Whether a name is that of a frame after the last one, such as frame_000048.png after
// frame_000047.png, and the first frame is not used: the names count from 1, and those of the clip
// from 0.
bool CountsFromOne(const std::string& unknown_name,
                   const TrackSet& tracks,
                   std::span<const FrameInfo> frames);

// Throws Error if no image of `path` belongs to the clip.
void CheckSomeImageKnown(const ImportedTracks& imported,
                         const std::string& path,
                         std::span<const FrameInfo> frames);

}  // namespace cohort
