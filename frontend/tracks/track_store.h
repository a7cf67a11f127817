#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "frontend/geometry/camera.h"
#include "frontend/storage/output.h"
#include "frontend/storage/write_lock.h"
#include "frontend/tracks/track_set.h"

namespace cohort {

struct FrameInfo {
  FrameIndex index{};
  std::string name;  // relative to image_root; a video's frames are named as if written out
  std::int64_t timestamp_ns = 0;
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
  std::map<std::string, std::string> meta;  // tracker, options as JSON, program version ...
  std::vector<FrameInfo> frames;            // ascending; also frames without observations
  TrackSet tracks;
  bool complete = true;  // false: tracking is still running, or stopped before the last frame

  bool KnowsCamera() const { return camera && camera->known; }
};

// Key in meta: Camera::row_order of the clip, if it is not down.
inline constexpr const char* kRowOrderMeta = "row_order";
RowOrder RowOrderOf(const TrackFile& file);

// Writes a .tracks file (SQLite; schema in docs/files.md) while tracking. Every AppendFrame is a
// transaction: however the program ends, the frames appended before are kept. `header` gives
// everything but frames and tracks.
//
//   auto writer = TrackWriter::Create("clip.tracks", header);
//   for each frame: writer.AppendFrame(info, observations, ends);
//   writer.Finish();
//
// A new PATH is written in place, marked unfinished until Finish. If PATH exists, PATH.partial is
// written and Finish renames it, so that PATH stays the old file until then. FindUnfinishedTracks
// finds either, ReadTrackFile reads it, and Resume continues it.
class TrackWriter {
 public:
  // Starts anew; discards what an earlier unfinished run left in PATH.partial.
  static TrackWriter Create(const std::filesystem::path& path, const TrackFile& header);
  // Continues after the last frame of FindUnfinishedTracks(path). Returns nullopt if there is no
  // such file, or if another run finished it meanwhile.
  static std::optional<TrackWriter> Resume(const std::filesystem::path& path);
  TrackWriter(TrackWriter&&) noexcept;
  TrackWriter& operator=(TrackWriter&&) noexcept;
  ~TrackWriter();

  // Frames ascend; `observations` are of this frame, `ends` of tracks that ended before it.
  void AppendFrame(const FrameInfo& frame,
                   const std::vector<Observation>& observations,
                   const std::vector<TrackEnd>& ends);
  std::optional<FrameIndex> last_frame() const;
  void SetMeta(const std::string& key, const std::string& value);
  void Finish();

 private:
  struct Impl;
  explicit TrackWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// PATH.partial or PATH itself, whichever holds unfinished work; nullopt if neither does.
std::optional<std::filesystem::path> FindUnfinishedTracks(const std::filesystem::path& path);

// Also reads unfinished files (see `complete`). Throws Error naming the path if the file is
// missing, damaged or no .tracks file.
TrackFile ReadTrackFile(const std::filesystem::path& path);
// Counts what ReadTrackFile would read, without it: the tracks of an hour of video fill the memory.
struct TrackCounts {
  std::size_t frames = 0;
  std::size_t tracks = 0;
  std::size_t observations = 0;  // with those predicted
  std::size_t predicted = 0;
};
TrackCounts CountTracks(const std::filesystem::path& path);

// Creates or replaces the file at a path, whole or not at all, and locks it from the start. Throws
// Error if another run is writing it.
class TrackFileOutput {
 public:
  explicit TrackFileOutput(const std::filesystem::path& path);
  void Write(const TrackFile& file);  // once

 private:
  std::filesystem::path path_;
  OutputFile out_;
  WriteLock replaced_;
};
void WriteTrackFile(const std::filesystem::path& path, const TrackFile& file);

}  // namespace cohort
