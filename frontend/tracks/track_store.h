#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "backend/geometry/camera.h"
#include "frontend/tracks/track_set.h"

namespace cohort {

struct FrameInfo {
  FrameIndex index{};
  std::string name;  // relative to image_root; a video's frames are named as if written out
  std::int64_t timestamp_ns = 0;
};

// What a .tracks file holds.
struct TrackFile {
  std::string source;      // the INPUT it was made of, absolute
  std::string image_root;  // folder that frame names are relative to, absolute; empty for a video
  int width_px = 0;
  int height_px = 0;
  std::optional<Camera> camera;             // none: nothing is known of it
  std::map<std::string, std::string> meta;  // tracker, options as JSON, program version ...
  std::vector<FrameInfo> frames;            // ascending; also frames without observations
  TrackSet tracks;
};

// Writes a .tracks file (SQLite; schema in frontend/README.md) while tracking: each AppendFrame is
// kept by a kill that comes after the next commit (every frame by default). `header` gives all but
// frames and tracks.
//
//   auto writer = TrackWriter::Create("clip.tracks", header);
//   for each frame: writer.AppendFrame(info, observations, ends);
//   writer.Finish();
//
// Create writes to PATH.partial and Finish renames it to PATH, so PATH is the old file or a
// complete one... until then the partial file opens with ReadTrackFile and Resume goes on with it.
class TrackWriter {
 public:
  static TrackWriter Create(const std::filesystem::path& path, const TrackFile& header);
  TrackWriter(TrackWriter&&) noexcept;
  TrackWriter& operator=(TrackWriter&&) noexcept;
  ~TrackWriter();

  void AppendFrame(const FrameInfo& frame,
                   const std::vector<Observation>& observations,
                   const std::vector<TrackEnd>& ends);
  void SetMeta(const std::string& key, const std::string& value);
  void Finish();

 private:
  struct Impl;
  explicit TrackWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// Throws Error naming the path on a file that is missing, is no .tracks file or is damaged.
TrackFile ReadTrackFile(const std::filesystem::path& path);
// Whole or not at all.
void WriteTrackFile(const std::filesystem::path& path, const TrackFile& file);

}  // namespace cohort
