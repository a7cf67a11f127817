#include "frontend/tracks/track_store.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <climits>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>

#include "frontend/core/error.h"
#include "frontend/geometry/camera_fault.h"
#include "frontend/storage/input_file.h"
#include "frontend/storage/output.h"
#include "frontend/storage/sqlite.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

// "cohr": distinguishes our SQLite files from others.
constexpr std::int64_t kApplicationId = 0x636F6872;
constexpr std::int64_t kVersion = 1;

constexpr const char* kSchema = R"(
  CREATE TABLE meta(key TEXT PRIMARY KEY NOT NULL, value TEXT NOT NULL) WITHOUT ROWID;
  CREATE TABLE camera(
    width_px INTEGER NOT NULL, height_px INTEGER NOT NULL,
    fx REAL NOT NULL, fy REAL NOT NULL, cx REAL NOT NULL, cy REAL NOT NULL,
    k1 REAL NOT NULL, k2 REAL NOT NULL, p1 REAL NOT NULL, p2 REAL NOT NULL,
    known INTEGER NOT NULL,
    model TEXT NOT NULL, k3 REAL NOT NULL, k4 REAL NOT NULL, k5 REAL NOT NULL, k6 REAL NOT NULL,
    guess_log_sigma REAL NOT NULL);
  CREATE TABLE frames(
    "index" INTEGER PRIMARY KEY NOT NULL, name TEXT NOT NULL, timestamp_ns INTEGER NOT NULL);
  CREATE TABLE observations(
    frame INTEGER NOT NULL REFERENCES frames("index"), track_id INTEGER NOT NULL,
    x REAL NOT NULL, y REAL NOT NULL, observed INTEGER NOT NULL, residual REAL NOT NULL,
    cov_xx REAL, cov_xy REAL, cov_yy REAL,
    PRIMARY KEY(frame, track_id)) WITHOUT ROWID;
  CREATE TABLE ends(
    track_id INTEGER PRIMARY KEY NOT NULL, last_frame INTEGER NOT NULL, reason TEXT NOT NULL);
)";

// Only in files with repeated frames.
constexpr const char* kRepeatsSchema = R"(
  CREATE TABLE repeats(
    "index" INTEGER PRIMARY KEY NOT NULL, name TEXT NOT NULL, timestamp_ns INTEGER NOT NULL,
    original INTEGER NOT NULL REFERENCES frames("index"));
)";

// The keys of table meta that are fields of TrackFile.
constexpr std::array<std::string_view, 4> kFieldKeys{
    "source", "image_root", "width_px", "height_px"};

bool IsFieldKey(std::string_view key) {
  return std::find(kFieldKeys.begin(), kFieldKeys.end(), key) != kFieldKeys.end();
}

void PutMeta(SqliteDatabase& db, std::string_view key, std::string_view value) {
  db.Prepare("INSERT OR REPLACE INTO meta VALUES(?, ?)").Bind(1, key).Bind(2, value).Run();
}

void PutCamera(SqliteDatabase& db, std::string_view table, const Camera& camera) {
  auto insert = db.Prepare(fmt::format(
      "INSERT INTO {} VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", table));
  insert.Bind(1, std::int64_t{camera.width_px}).Bind(2, std::int64_t{camera.height_px});
  insert.Bind(3, camera.fx).Bind(4, camera.fy).Bind(5, camera.cx).Bind(6, camera.cy);
  insert.Bind(7, camera.k1).Bind(8, camera.k2).Bind(9, camera.p1).Bind(10, camera.p2);
  insert.Bind(11, std::int64_t{camera.known});
  insert.Bind(12, NameOf(kCameraModelNames, camera.model));
  insert.Bind(13, camera.k3).Bind(14, camera.k4).Bind(15, camera.k5).Bind(16, camera.k6);
  insert.Bind(17, camera.guess_log_sigma).Run();
}

void PutRepeats(SqliteDatabase& db, const std::vector<RepeatedFrame>& repeats) {
  db.Execute(kRepeatsSchema);
  auto insert = db.Prepare("INSERT INTO repeats VALUES(?, ?, ?, ?)");
  for (const auto& [frame, original] : repeats) {
    insert.Bind(1, std::int64_t{ToInt(frame.index)}).Bind(2, frame.name);
    insert.Bind(3, frame.timestamp_ns).Bind(4, std::int64_t{ToInt(original)}).Run();
  }
}

void CreateSchema(SqliteDatabase& db, const TrackFile& header) {
  db.Execute(fmt::format("PRAGMA application_id = {}; PRAGMA user_version = {};{}",
                         kApplicationId,
                         kVersion,
                         kSchema));
  for (const auto& [key, value] : RowsOf(header.meta)) {
    Check(!IsFieldKey(key), "meta keys of a .tracks file are not its fields' names");
    PutMeta(db, key, value);
  }
  PutMeta(db, "source", header.source);
  PutMeta(db, "image_root", header.image_root);
  PutMeta(db, "width_px", std::to_string(header.width_px));
  PutMeta(db, "height_px", std::to_string(header.height_px));
  if (header.camera) PutCamera(db, "camera", *header.camera);
  if (!header.repeats.empty()) PutRepeats(db, header.repeats);
  if (header.found_camera) {
    db.Execute("CREATE TABLE found_camera AS SELECT * FROM camera WHERE 0");
    PutCamera(db, "found_camera", *header.found_camera);
  }
}

// The statements that add rows, prepared once.
struct Inserter {
  explicit Inserter(SqliteDatabase& db)
      : frame(db.Prepare("INSERT INTO frames VALUES(?, ?, ?)")),
        observation(db.Prepare("INSERT INTO observations VALUES(?, ?, ?, ?, ?, ?, ?, ?, ?)")),
        end(db.Prepare("INSERT INTO ends VALUES(?, ?, ?)")) {}

  void Insert(const FrameInfo& f) {
    frame.Bind(1, std::int64_t{ToInt(f.index)}).Bind(2, f.name).Bind(3, f.timestamp_ns).Run();
  }
  void Insert(const Observation& o) {
    observation.Bind(1, std::int64_t{ToInt(o.frame)}).Bind(2, std::int64_t{ToInt(o.feature)});
    observation.Bind(3, o.xy.x()).Bind(4, o.xy.y());
    observation.Bind(5, std::int64_t{o.state == ObservationState::kObserved}).Bind(6, o.residual);
    if (o.covariance) {
      observation.Bind(7, double{o.covariance->xx});
      observation.Bind(8, double{o.covariance->xy}).Bind(9, double{o.covariance->yy});
    } else {
      observation.BindNull(7).BindNull(8).BindNull(9);
    }
    observation.Run();
  }
  void Insert(const TrackEnd& e) {
    end.Bind(1, std::int64_t{ToInt(e.feature)}).Bind(2, std::int64_t{ToInt(e.last_frame)});
    end.Bind(3, NameOf(kLossReasonNames, e.reason)).Run();
  }

  SqliteStatement frame, observation, end;
};

[[noreturn]] void ThrowDamaged(const fs::path& path, std::string_view what) {
  ThrowError("{} is damaged: {}; make it again", path.string(), what);
}

std::uint32_t ReadId(std::int64_t value, const fs::path& path, std::string_view what) {
  if (value < 0 || value > std::int64_t{UINT32_MAX}) {
    ThrowDamaged(path, fmt::format("it has {} {}", what, value));
  }
  return static_cast<std::uint32_t>(value);
}

// The limit is that of COLMAP's models, which number images from 1.
std::uint32_t ReadFrameIndex(std::int64_t value, const fs::path& path) {
  constexpr std::int64_t kMost = 2'147'483'645;
  if (value > kMost) ThrowDamaged(path, fmt::format("it has frame {} of {} at most", value, kMost));
  return ReadId(value, path, "frame");
}

int ReadSize(const std::string& text, const fs::path& path) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < 0 ||
      value > kMaxPictureSidePx) {
    ThrowDamaged(path, fmt::format("'{}' is not an image size", text));
  }
  return value;
}

CameraModel ReadCameraModel(std::string_view name, const fs::path& path) {
  if (const auto model = ValueOf(kCameraModelNames, name)) return *model;
  ThrowError("{} has a camera of model '{}', which this program does not know: use a newer one",
             path.string(),
             name);
}

std::optional<Camera> ReadCamera(SqliteDatabase& db, std::string_view table, const fs::path& path) {
  auto row = db.Prepare(fmt::format(
      "SELECT width_px, height_px, fx, fy, cx, cy, k1, k2, p1, p2, known, model, k3, k4, k5, k6, "
      "guess_log_sigma FROM {}",
      table));
  if (!row.Step()) return std::nullopt;
  const auto side = [&](int column) {
    return static_cast<int>(std::clamp<std::int64_t>(row.Int(column), -1, INT_MAX));
  };
  const Camera camera{.width_px = side(0),
                      .height_px = side(1),
                      .fx = row.Real(2),
                      .fy = row.Real(3),
                      .cx = row.Real(4),
                      .cy = row.Real(5),
                      .k1 = row.Real(6),
                      .k2 = row.Real(7),
                      .p1 = row.Real(8),
                      .p2 = row.Real(9),
                      .k3 = row.Real(12),
                      .k4 = row.Real(13),
                      .k5 = row.Real(14),
                      .k6 = row.Real(15),
                      .model = ReadCameraModel(row.Text(11), path),
                      .known = row.Int(10) != 0,
                      .guess_log_sigma = row.Real(16)};
  if (const std::string fault = FaultOf(camera); !fault.empty()) ThrowDamaged(path, fault);
  return camera;
}

SqliteDatabase OpenTracks(const fs::path& path) {
  CheckInputFile(path);
  auto db = SqliteDatabase::Open(path, SqliteDatabase::Mode::kRead);
  auto id = db.Prepare("PRAGMA application_id");
  if (!id.Step() || id.Int(0) != kApplicationId) {
    ThrowError("{} is not a .tracks file of cohort", path.string());
  }
  if (db.UserVersion() != kVersion) {
    ThrowError(
        "{} is a .tracks file of version {}, but this program reads version {}: make it again",
        path.string(),
        db.UserVersion(),
        kVersion);
  }
  return db;
}

std::vector<Observation> ReadObservations(SqliteDatabase& db, const fs::path& path) {
  std::vector<Observation> observations;
  auto count = db.Prepare("SELECT COUNT(frame) FROM observations");
  constexpr std::uint64_t kBytesARow = 16;  // at least, unless the file is malicious
  if (count.Step()) {
    observations.reserve(std::min(static_cast<std::uint64_t>(count.Int(0)),
                                  static_cast<std::uint64_t>(fs::file_size(path)) / kBytesARow));
  }
  auto row = db.Prepare(
      "SELECT frame, track_id, x, y, observed, residual, cov_xx, cov_xy, cov_yy "
      "FROM observations ORDER BY frame, track_id");
  while (row.Step()) {
    Observation& o = observations.emplace_back();
    o.frame = FrameIndex{ReadId(row.Int(0), path, "frame")};
    o.feature = FeatureId{ReadId(row.Int(1), path, "track")};
    o.xy = {row.Real(2), row.Real(3)};
    o.state = row.Int(4) != 0 ? ObservationState::kObserved : ObservationState::kPredicted;
    o.residual = row.Real(5);
    if (!std::isfinite(o.residual)) {
      ThrowDamaged(path, fmt::format("a residual of track {} is not finite", ToInt(o.feature)));
    }
    if (!row.IsNull(6)) {
      o.covariance = PixelCovariance{.xx = static_cast<float>(row.Real(6)),
                                     .xy = static_cast<float>(row.Real(7)),
                                     .yy = static_cast<float>(row.Real(8))};
      const PixelCovariance& c = *o.covariance;
      if (!PixelCovariance::IsOne(c.xx, c.xy, c.yy)) {
        ThrowDamaged(
            path,
            fmt::format("a covariance of track {} is not positive definite: xx {}, xy {}, yy {}",
                        ToInt(o.feature),
                        c.xx,
                        c.xy,
                        c.yy));
      }
    }
  }
  return observations;
}

// Columns: index, name, timestamp_ns.
FrameInfo ReadFrame(SqliteStatement& row, const fs::path& path) {
  FrameInfo frame{.index = FrameIndex{ReadFrameIndex(row.Int(0), path)},
                  .name = std::string(row.Text(1)),
                  .timestamp_ns = row.Int(2)};
  // Frames that did not come from files may have no name.
  if (const std::string fault = FaultOfPictureName(frame.name);
      !frame.name.empty() && !fault.empty()) {
    ThrowDamaged(path, fmt::format("the name of frame '{}' {}", frame.name, fault));
  }
  return frame;
}

std::vector<RepeatedFrame> ReadRepeats(SqliteDatabase& db,
                                       const std::vector<FrameInfo>& frames,
                                       const fs::path& path) {
  std::vector<RepeatedFrame> repeats;
  const auto is_listed = [&frames](FrameIndex index) {
    return std::ranges::binary_search(frames, index, {}, &FrameInfo::index);
  };
  auto row =
      db.Prepare("SELECT \"index\", name, timestamp_ns, original FROM repeats ORDER BY \"index\"");
  while (row.Step()) {
    const RepeatedFrame& repeat = repeats.emplace_back(
        RepeatedFrame{ReadFrame(row, path), FrameIndex{ReadFrameIndex(row.Int(3), path)}});
    if (is_listed(repeat.frame.index) || !is_listed(repeat.original)) {
      ThrowDamaged(path,
                   fmt::format("its frame {} cannot repeat frame {}",
                               ToInt(repeat.frame.index),
                               ToInt(repeat.original)));
    }
  }
  return repeats;
}

std::vector<TrackEnd> ReadEnds(SqliteDatabase& db, const fs::path& path) {
  std::vector<TrackEnd> ends;
  auto row = db.Prepare("SELECT track_id, last_frame, reason FROM ends ORDER BY track_id");
  while (row.Step()) {
    const auto* name = std::find_if(kLossReasonNames.begin(),
                                    kLossReasonNames.end(),
                                    [&](const auto& entry) { return entry.first == row.Text(2); });
    if (name == kLossReasonNames.end()) {
      ThrowDamaged(path, fmt::format("'{}' is not a reason to end a track", row.Text(2)));
    }
    ends.push_back({.feature = FeatureId{ReadId(row.Int(0), path, "track")},
                    .last_frame = FrameIndex{ReadId(row.Int(1), path, "frame")},
                    .reason = name->second});
  }
  return ends;
}

}  // namespace

TrackFile ReadTrackFile(const fs::path& path) {
  auto db = OpenTracks(path);
  TrackFile file;
  auto meta = db.Prepare("SELECT key, value FROM meta");
  std::map<std::string, std::string> rows;
  while (meta.Step()) rows.emplace(meta.Text(0), meta.Text(1));
  const auto take = [&](const char* key) {
    const auto node = rows.extract(key);
    if (node.empty()) ThrowDamaged(path, fmt::format("table meta has no {}", key));
    return node.mapped();
  };
  file.source = take("source");
  file.image_root = take("image_root");
  file.width_px = ReadSize(take("width_px"), path);
  file.height_px = ReadSize(take("height_px"), path);
  file.meta = MetaOfRows(std::move(rows));
  file.camera = ReadCamera(db, "camera", path);
  if (db.HasTable("found_camera")) file.found_camera = ReadCamera(db, "found_camera", path);
  if (file.found_camera &&
      (file.found_camera->known || file.found_camera->width_px != file.width_px ||
       file.found_camera->height_px != file.height_px)) {
    ThrowDamaged(path, "the camera that was found does not belong to these pictures");
  }
  auto frames = db.Prepare("SELECT \"index\", name, timestamp_ns FROM frames ORDER BY \"index\"");
  while (frames.Step()) file.frames.push_back(ReadFrame(frames, path));
  if (db.HasTable("repeats")) file.repeats = ReadRepeats(db, file.frames, path);
  if (!file.frames.empty() && (file.width_px == 0 || file.height_px == 0)) {
    ThrowDamaged(path, "it has frames without a size");
  }
  auto unlisted = db.Prepare(
      "SELECT frame FROM observations WHERE frame NOT IN (SELECT \"index\" FROM frames) LIMIT 1");
  if (unlisted.Step()) {
    ThrowDamaged(path,
                 fmt::format("it has observations in frame {}, which is not in table frames",
                             unlisted.Int(0)));
  }
  try {
    file.tracks = TrackSet::Build(ReadObservations(db, path), ReadEnds(db, path));
  } catch (const Error& error) {
    ThrowError("{}: {}", path.string(), error.what());
  }
  return file;
}

void WriteTrackFile(const fs::path& path, const TrackFile& file) {
  OutputFile out(path);
  {
    auto db = SqliteDatabase::Open(out.partial(), SqliteDatabase::Mode::kCreate);
    // The file is discarded if anything fails, so no journal is needed.
    db.Execute("PRAGMA journal_mode = OFF");
    SqliteTransaction transaction(db);
    CreateSchema(db, file);
    Inserter insert(db);
    std::size_t inserted = 0;
    for (const FrameInfo& frame : file.frames) {
      insert.Insert(frame);
      for (const Observation* observation : file.tracks.InFrame(frame.index)) {
        insert.Insert(*observation);
        ++inserted;
      }
    }
    if (inserted != file.tracks.observations().size()) {
      ThrowError("cannot write {}: it has observations in frames that its list of frames lacks",
                 path.string());
    }
    for (const TrackEnd& end : file.tracks.ends()) insert.Insert(end);
    transaction.Commit();
  }
  RemoveJournals(path);  // left by another program
  out.Commit();
}

}  // namespace cohort
