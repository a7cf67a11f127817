#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "frontend/geometry/camera.h"
#include "frontend/tracks/track_meta.h"
#include "frontend/tracks/track_set.h"

namespace cohort {

struct FrameInfo {
  FrameIndex index{};
  std::string name;  // relative to image_root; a video's frames are named as if written out
  std::int64_t timestamp_ns = 0;
};

// A frame that shows the picture of an earlier one once more. It has no tracks of its own: its pose
// is that of the original.
struct RepeatedFrame {
  FrameInfo frame;
  FrameIndex original{};
};

// The contents of a .tracks file.
struct TrackFile {
  std::string source;      // the INPUT that it was made from, absolute
  std::string image_root;  // folder that frame names are relative to, absolute; empty for a video
  int width_px = 0;
  int height_px = 0;
  std::optional<Camera> camera;  // nullopt: nothing is known of it
  // For an unknown camera: the camera of a model of these tracks (the second pass), from which the
  // next search starts. It does not make the camera known.
  std::optional<Camera> found_camera;
  TrackMeta meta;
  std::vector<FrameInfo> frames;  // ascending; also frames without observations, but no repeats
  std::vector<RepeatedFrame> repeats;  // ascending
  TrackSet tracks;

  bool KnowsCamera() const { return camera && camera->known; }
  std::size_t FrameCount() const { return frames.size() + repeats.size(); }  // of the clip
};

// Throws Error naming the path if the file is missing, damaged or not a .tracks file.
TrackFile ReadTrackFile(const std::filesystem::path& path);

// Creates or replaces a .tracks file (SQLite; schema in docs/files.md), whole or not at all.
void WriteTrackFile(const std::filesystem::path& path, const TrackFile& file);

}  // namespace cohort
