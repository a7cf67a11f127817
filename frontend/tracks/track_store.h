#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "frontend/core/output.h"
#include "frontend/core/write_lock.h"
#include "frontend/geometry/camera.h"
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
  std::optional<Camera> camera;  // none: nothing is known of it
  // Where the camera is not known: the one that a model of these tracks has (the second pass), where the
  // next one begins its search. It says nothing of what is known of the camera.
  std::optional<Camera> found_camera;
  std::map<std::string, std::string> meta;  // tracker, options as JSON, program version ...
  std::vector<FrameInfo> frames;            // ascending; also frames without observations
  TrackSet tracks;
  bool complete = true;  // false: tracking still runs, or was ended before the last frame

  bool KnowsCamera() const { return camera && camera->known; }
};

// In meta: Camera::row_order of the clip, where it is not down.
inline constexpr const char* kRowOrderMeta = "row_order";
RowOrder RowOrderOf(const TrackFile& file);

// Writes a .tracks file (SQLite; schema in docs/files.md) while tracking. Every AppendFrame is
// a transaction: whatever ends the program, the frames appended before are kept. `header` gives all
// but frames and tracks.
//
//   auto writer = TrackWriter::Create("clip.tracks", header);
//   for each frame: writer.AppendFrame(info, observations, ends);
//   writer.Finish();
//
// Where PATH does not exist, it is written in place, marked unfinished until Finish. Where it does,
// PATH.partial is written and Finish renames it, so that PATH stays the old file until then. Either
// is found by FindUnfinishedTracks, read by ReadTrackFile and continued by Resume.
class TrackWriter {
 public:
  // Starts anew: what an earlier unfinished run has left in PATH.partial is lost.
  static TrackWriter Create(const std::filesystem::path& path, const TrackFile& header);
  // Goes on behind the last frame of FindUnfinishedTracks(path). None: there is none, or no more where
  // another run had it when this one asked.
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

// PATH.partial or PATH itself, whichever holds the work of a run that did not end; else none.
std::optional<std::filesystem::path> FindUnfinishedTracks(const std::filesystem::path& path);

// Reads unfinished files too (`complete` says so). Throws Error naming the path on a file that is
// missing, is no .tracks file or is damaged.
TrackFile ReadTrackFile(const std::filesystem::path& path);
// What ReadTrackFile would find, counted without it: of an hour of video the tracks fill the memory.
struct TrackCounts {
  std::size_t frames = 0;
  std::size_t tracks = 0;
  std::size_t observations = 0;  // with those predicted
  std::size_t predicted = 0;
};
TrackCounts CountTracks(const std::filesystem::path& path);

// Makes or replaces the file at a path: whole or not at all, and from the beginning on nobody else may.
// Throws Error where another run is writing it.
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
