#pragma once

#include <map>
#include <string>
#include <vector>

#include "frontend/geometry/camera.h"
#include "frontend/tracks/observation.h"

namespace cohort {

// How the tracks of a file were made, as far as it is known. The file keeps it in its table meta
// (docs/files.md), a text for each field that is not empty.
struct TrackMeta {
  std::string program = {};  // with its version
  std::string tracker = {};  // "import": the tracks are of another program
  std::string options = {};  // of the tracker, as JSON

  bool second_pass = false;              // its tracks are these
  std::string no_second_pass = {};       // why there is none, if it was asked for
  std::string second_pass_options = {};  // as JSON; empty: it was not asked for

  std::string imported_from = {};  // absolute paths
  std::string refined_from = {};
  std::string mask = {};
  std::string mask_fingerprint = {};
  // What was done about fixed parts of the pictures: "masked", "off" if they were not looked for;
  // empty if there are none.
  std::string fixed_parts = {};

  std::string fingerprint = {};  // of the clip's files
  std::string frames = {};       // the values of --frames and --layout that opened the clip
  std::string layout = {};
  std::string focal_source = {};      // the entry of the clip's files that gave a guess
  std::string warning = {};           // a defect of the clip, such as an end before its last frame
  std::vector<FrameIndex> cuts = {};  // the first frames of further scenes, ascending
  RowOrder row_order = RowOrder::kDown;  // Camera::row_order of the clip

  std::map<std::string, std::string> other = {};  // by programs that know more fields

  bool operator==(const TrackMeta&) const = default;
};

// The rows of table meta and back.
std::map<std::string, std::string> RowsOf(const TrackMeta& meta);
TrackMeta MetaOfRows(std::map<std::string, std::string> rows);

}  // namespace cohort
