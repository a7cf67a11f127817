#include "frontend/tracks/opensfm_tracks.h"

#include <algorithm>
#include <map>
#include <set>

#include "frontend/tracks/text_rows.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

constexpr std::string_view kHeader = "OPENSFM_TRACKS_VERSION_v";
constexpr int kNewestVersion = 2;
constexpr std::size_t kFieldsOfVersion[] = {8, 9, 11};

std::vector<std::string_view> SplitAtTabs(std::string_view line) {
  std::vector<std::string_view> fields;
  for (std::size_t begin = 0; begin <= line.size();) {
    const std::size_t tab = std::min(line.find('\t', begin), line.size());
    fields.push_back(line.substr(begin, tab - begin));
    begin = tab + 1;
  }
  return fields;
}

}  // namespace

std::size_t WriteOpenSfmTracks(const fs::path& path, const TrackFile& file) {
  Check(file.width_px > 0 && file.height_px > 0, "the image size is known");
  const double longer_px = std::max(file.width_px, file.height_px);
  std::set<FeatureId> written;
  TextOutput out(path);
  out.Text(kHeader).Text("2").EndLine();
  for (const FrameInfo& frame : file.frames) {
    int feature_in_image = 0;
    for (const Observation* o : file.tracks.InFrame(frame.index)) {
      if (!IsObserved(*o)) continue;
      written.insert(o->feature);
      out.Text(frame.name).Text("\t").Number(ToInt(o->feature)).Text("\t");
      out.Number(feature_in_image++).Text("\t");
      out.Number((o->xy.x() + 0.5 - 0.5 * file.width_px) / longer_px).Text("\t");
      out.Number((o->xy.y() + 0.5 - 0.5 * file.height_px) / longer_px).Text("\t");
      out.Number(1.0 / longer_px).Text("\t0\t0\t0\t-1\t-1").EndLine();
    }
  }
  out.Commit();
  return written.size();
}

ImportedTracks ReadOpenSfmTracks(const fs::path& path,
                                 std::span<const FrameInfo> frames,
                                 int width_px,
                                 int height_px) {
  Check(width_px > 0 && height_px > 0, "the image size is known");
  const double longer_px = std::max(width_px, height_px);
  FrameNames names(frames);
  std::map<std::string, std::optional<FrameIndex>> frame_of_image;
  LineReader reader(path);
  if (!reader.Next()) ThrowError("{} is empty", path.string());
  int version = 0;
  bool at_row = true;
  if (reader.line().starts_with(kHeader)) {
    const auto named = Parse<int>(reader.line().substr(kHeader.size()));
    if (!named || *named < 0 || *named > kNewestVersion) {
      reader.Throw("version '{}' of OpenSfM's tracks is not supported: 0 to {} are",
                   reader.line().substr(kHeader.size()),
                   kNewestVersion);
    }
    version = *named;
    at_row = reader.Next();
  }
  ImportedTracks result;
  TrackRows rows;
  for (; at_row; at_row = reader.Next()) {
    const auto fields = SplitAtTabs(reader.line());
    if (fields.size() != kFieldsOfVersion[version]) {
      reader.Throw("{} fields between tabs, but OpenSfM's version {} has {}",
                   fields.size(),
                   version,
                   kFieldsOfVersion[version]);
    }
    const auto id = ParseId<std::uint64_t>(reader, "track_id", fields[1]);
    const double x = ParseFinite(reader, "x", fields[3]);
    const double y = ParseFinite(reader, "y", fields[4]);
    const std::string name(fields[0]);
    auto image = frame_of_image.find(name);
    if (image == frame_of_image.end()) {
      image = frame_of_image.emplace(name, names.Find(name)).first;
      if (!image->second && result.unknown_images++ == 0) result.an_unknown_image = name;
    }
    if (!image->second) continue;
    Observation& row = rows.Add(reader, id);
    row.frame = *image->second;
    row.xy = {x * longer_px + 0.5 * width_px - 0.5, y * longer_px + 0.5 * height_px - 0.5};
  }
  if (rows.empty() && result.unknown_images == 0) ThrowError("{} has no rows", path.string());
  result.tracks = std::move(rows).Build(reader).tracks;
  CheckSomeImageKnown(result, path.string(), frames);
  return result;
}

}  // namespace cohort
