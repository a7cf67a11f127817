#include "backend/colmap/database.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <cmath>
#include <cstring>
#include <functional>
#include <set>
#include <span>

#include "frontend/geometry/camera_fault.h"
#include "frontend/storage/input_file.h"
#include "frontend/storage/output.h"
#include "frontend/storage/sqlite.h"

namespace cohort {
namespace {

constexpr std::int64_t kMaxImages = 2147483647;
constexpr std::int64_t kUserVersion = 3800;
constexpr std::int64_t kMaxKeypoints = std::int64_t{1} << 32;  // of an image

// COLMAP reads cameras, images, matches and two_view_geometries by column number, so the order
// matters.
constexpr const char* kSchema = R"(
CREATE TABLE cameras
   (camera_id            INTEGER  PRIMARY KEY AUTOINCREMENT  NOT NULL,
    model                INTEGER                             NOT NULL,
    width                INTEGER                             NOT NULL,
    height               INTEGER                             NOT NULL,
    params               BLOB,
    prior_focal_length   INTEGER                             NOT NULL);
CREATE TABLE images
   (image_id  INTEGER  PRIMARY KEY AUTOINCREMENT  NOT NULL,
    name      TEXT                                NOT NULL UNIQUE,
    camera_id INTEGER                             NOT NULL,
    prior_qw  REAL,
    prior_qx  REAL,
    prior_qy  REAL,
    prior_qz  REAL,
    prior_tx  REAL,
    prior_ty  REAL,
    prior_tz  REAL,
    CONSTRAINT image_id_check CHECK(image_id >= 0 and image_id < 2147483647),
    FOREIGN KEY(camera_id) REFERENCES cameras(camera_id));
CREATE UNIQUE INDEX index_name ON images(name);
CREATE TABLE keypoints
   (image_id  INTEGER  PRIMARY KEY  NOT NULL,
    rows      INTEGER               NOT NULL,
    cols      INTEGER               NOT NULL,
    data      BLOB,
    FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE descriptors
   (image_id  INTEGER  PRIMARY KEY  NOT NULL,
    rows      INTEGER               NOT NULL,
    cols      INTEGER               NOT NULL,
    data      BLOB,
    FOREIGN KEY(image_id) REFERENCES images(image_id) ON DELETE CASCADE);
CREATE TABLE matches
   (pair_id  INTEGER  PRIMARY KEY  NOT NULL,
    rows     INTEGER               NOT NULL,
    cols     INTEGER               NOT NULL,
    data     BLOB);
CREATE TABLE two_view_geometries
   (pair_id  INTEGER  PRIMARY KEY  NOT NULL,
    rows     INTEGER               NOT NULL,
    cols     INTEGER               NOT NULL,
    data     BLOB,
    config   INTEGER               NOT NULL,
    F        BLOB,
    E        BLOB,
    H        BLOB,
    qvec     BLOB,
    tvec     BLOB);
)";

using RowMajor3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

template <typename T>
std::span<const std::byte> AsBytes(const std::vector<T>& values) {
  return std::as_bytes(std::span(values));
}

template <typename T>
std::vector<T> FromBytes(std::span<const std::byte> bytes,
                         std::int64_t count,
                         const std::filesystem::path& path,
                         const char* table) {
  // Divides, because the product with a number from a file may overflow.
  if (count < 0 || bytes.size() % sizeof(T) != 0 ||
      bytes.size() / sizeof(T) != static_cast<std::size_t>(count)) {
    ThrowError(
        "COLMAP database {}: a blob of table {} has {} bytes instead of {} values of {} bytes",
        path.string(),
        table,
        bytes.size(),
        count,
        sizeof(T));
  }
  std::vector<T> values(static_cast<std::size_t>(count));
  if (!bytes.empty()) std::memcpy(values.data(), bytes.data(), bytes.size());
  return values;
}

void BindMatrix(SqliteStatement& statement,
                int parameter,
                const std::optional<Eigen::Matrix3d>& matrix) {
  if (!matrix) {
    statement.BindNull(parameter);
    return;
  }
  const RowMajor3 rows = *matrix;
  statement.Bind(parameter, std::as_bytes(std::span(rows.data(), 9)));
}

std::optional<Eigen::Matrix3d> ReadMatrix(const SqliteStatement& statement,
                                          int column,
                                          const std::filesystem::path& path) {
  if (statement.Blob(column).empty()) return std::nullopt;
  const auto values = FromBytes<double>(statement.Blob(column), 9, path, "two_view_geometries");
  const Eigen::Matrix3d matrix = Eigen::Map<const RowMajor3>(values.data());
  if (matrix.norm() == 0.0) return std::nullopt;  // unset, in 3.x
  return matrix;
}

std::vector<ColmapMatch> SwapColumns(std::vector<ColmapMatch> matches) {
  for (ColmapMatch& match : matches) std::swap(match[0], match[1]);
  return matches;
}

void CheckIndices(const std::vector<ColmapMatch>& matches,
                  const ColmapImage& image1,
                  const ColmapImage& image2,
                  const std::string& database) {
  for (const ColmapMatch& match : matches) {
    if (match[0] < image1.keypoints.size() && match[1] < image2.keypoints.size()) continue;
    ThrowError("{}: a match of images {} and {} points past their {} and {} keypoints",
               database,
               image1.name,
               image2.name,
               image1.keypoints.size(),
               image2.keypoints.size());
  }
}

void CheckMatchedOnce(const std::vector<ColmapMatch>& matches,
                      const ColmapImage& image1,
                      const ColmapImage& image2,
                      const std::string& database) {
  std::set<std::uint32_t> used1, used2;
  for (const ColmapMatch& match : matches) {
    if (!used1.insert(match[0]).second || !used2.insert(match[1]).second) {
      ThrowError("{}: images {} and {} match a keypoint twice", database, image1.name, image2.name);
    }
  }
}

// The id of the camera shared by all images; an image's own camera has the image's id.
constexpr std::int64_t kCameraId = 1;

void WriteCameras(SqliteDatabase& db, const ColmapDatabase& database) {
  auto insert = db.Prepare("INSERT INTO cameras VALUES(?, ?, ?, ?, ?, ?)");
  const auto write = [&insert](std::int64_t id, const ColmapCamera& camera) {
    insert.Bind(1, id)
        .Bind(2, static_cast<std::int64_t>(camera.model))
        .Bind(3, std::int64_t{camera.width_px})
        .Bind(4, std::int64_t{camera.height_px})
        .Bind(5, AsBytes(camera.params))
        .Bind(6, std::int64_t{camera.prior_focal_length})
        .Run();
  };
  if (database.camera_of_image.empty()) write(kCameraId, database.camera);
  for (const auto& [id, camera] : database.camera_of_image) write(id, camera);
}

void WriteRows(SqliteDatabase& db, const ColmapDatabase& database) {
  WriteCameras(db, database);
  auto insert_image = db.Prepare("INSERT INTO images(image_id, name, camera_id) VALUES(?, ?, ?)");
  auto insert_keypoints = db.Prepare("INSERT INTO keypoints VALUES(?, ?, 2, ?)");
  for (const auto& [id, image] : database.images) {
    const std::int64_t camera_id = database.camera_of_image.empty() ? kCameraId : id;
    insert_image.Bind(1, std::int64_t{id}).Bind(2, image.name).Bind(3, camera_id).Run();
    insert_keypoints.Bind(1, std::int64_t{id})
        .Bind(2, static_cast<std::int64_t>(image.keypoints.size()))
        .Bind(3, AsBytes(image.keypoints))
        .Run();
  }

  auto insert_matches = db.Prepare("INSERT INTO matches VALUES(?, ?, 2, ?)");
  auto insert_geometry =
      db.Prepare("INSERT INTO two_view_geometries VALUES(?, ?, 2, ?, ?, ?, ?, ?, ?, ?)");
  for (const auto& [images, pair] : database.pairs) {
    const std::int64_t pair_id = ColmapPairId(images.first, images.second);
    insert_matches.Bind(1, pair_id)
        .Bind(2, static_cast<std::int64_t>(pair.matches.size()))
        .Bind(3, AsBytes(pair.matches))
        .Run();
    if (!pair.geometry) continue;
    const ColmapTwoViewGeometry& g = *pair.geometry;
    insert_geometry.Bind(1, pair_id)
        .Bind(2, static_cast<std::int64_t>(g.inliers.size()))
        .Bind(3, AsBytes(g.inliers))
        .Bind(4, static_cast<std::int64_t>(g.config));
    BindMatrix(insert_geometry, 5, g.fundamental);
    BindMatrix(insert_geometry, 6, g.essential);
    BindMatrix(insert_geometry, 7, g.homography);
    if (g.cam2_from_cam1) {
      const Eigen::Quaterniond& q = g.cam2_from_cam1->rotation;
      const double qvec[4] = {q.w(), q.x(), q.y(), q.z()};
      insert_geometry.Bind(8, std::as_bytes(std::span(qvec)));
      insert_geometry.Bind(9, std::as_bytes(std::span(g.cam2_from_cam1->translation.data(), 3)));
    } else {
      insert_geometry.BindNull(8).BindNull(9);
    }
    insert_geometry.Run();
  }
}

// The columns that are read; further columns of other schema versions, and their order, do not
// matter.
constexpr std::pair<const char*, std::array<const char*, 9>> kColumns[] = {
    {"cameras", {"camera_id", "model", "width", "height", "params", "prior_focal_length"}},
    {"images", {"image_id", "name", "camera_id"}},
    {"keypoints", {"image_id", "rows", "cols", "data"}},
    {"matches", {"pair_id", "rows", "data"}},
    {"two_view_geometries", {"pair_id", "rows", "data", "config", "F", "E", "H", "qvec", "tvec"}}};

void CheckSchema(SqliteDatabase& db, const std::filesystem::path& path) {
  for (const auto& [table, columns] : kColumns) {
    if (!db.HasTable(table)) {
      ThrowError("{} is not a COLMAP database: it has no table {}", path.string(), table);
    }
    std::set<std::string, std::less<>> found;
    auto info = db.Prepare("SELECT name FROM pragma_table_info(?)");
    info.Bind(1, std::string_view(table));
    while (info.Step()) found.emplace(info.Text(0));
    for (const char* column : columns) {
      if (column == nullptr || found.contains(std::string_view(column))) continue;
      ThrowError(
          "COLMAP database {} has no {}.{} (schema {}): only the schemas of COLMAP 3.8 to 4.x are "
          "supported",
          path.string(),
          table,
          column,
          db.UserVersion());
    }
  }
}

ColmapCamera ReadCamera(const SqliteStatement& row, const std::filesystem::path& path) {
  ColmapCamera camera;
  camera.model = static_cast<ColmapCameraModel>(row.Int(0));
  const std::int64_t width = row.Int(1);
  const std::int64_t height = row.Int(2);
  if (width < 1 || height < 1 || width > kMaxPictureSidePx || height > kMaxPictureSidePx) {
    ThrowError("COLMAP database {}: a camera has the invalid picture size {} x {}",
               path.string(),
               width,
               height);
  }
  camera.width_px = static_cast<int>(width);
  camera.height_px = static_cast<int>(height);
  camera.params = FromBytes<double>(
      row.Blob(3), static_cast<std::int64_t>(ColmapParameterCount(camera.model)), path, "cameras");
  for (const double parameter : camera.params) {
    if (!std::isfinite(parameter)) {
      ThrowError("COLMAP database {}: a camera has a parameter that is not finite", path.string());
    }
  }
  camera.prior_focal_length = row.Int(4) != 0;
  return camera;
}

// By default COLMAP creates one camera per image. The one that they are is calibrated if all are.
ColmapCamera ReadCameras(SqliteDatabase& db, const std::filesystem::path& path) {
  auto rows = db.Prepare(
      "SELECT model, width, height, params, prior_focal_length FROM cameras "
      "WHERE camera_id IN (SELECT camera_id FROM images) ORDER BY camera_id");
  std::optional<ColmapCamera> camera;
  while (rows.Step()) {
    const ColmapCamera next = ReadCamera(rows, path);
    if (!camera) camera = next;
    if (AreAsOne(next, *camera)) {
      camera->prior_focal_length = camera->prior_focal_length && next.prior_focal_length;
      continue;
    }
    ThrowError(
        "COLMAP database {} has several cameras that differ: give a database of a clip with one "
        "camera (colmap feature_extractor --ImageReader.single_camera 1)",
        path.string());
  }
  if (!camera) {
    const bool has_images = db.Prepare("SELECT 1 FROM images").Step();
    ThrowError("COLMAP database {} has no {}: run colmap feature_extractor and a matcher on it",
               path.string(),
               has_images ? "camera of its images" : "images");
  }
  return *camera;
}

std::map<ColmapImageId, ColmapImage> ReadImages(SqliteDatabase& db,
                                                const std::filesystem::path& path) {
  std::map<ColmapImageId, ColmapImage> result;
  auto images = db.Prepare(
      "SELECT image_id, name, rows, cols, data FROM images LEFT JOIN keypoints USING(image_id)");
  while (images.Step()) {
    const std::int64_t id = images.Int(0);
    if (id < 1 || id >= kMaxImages) {
      ThrowError("COLMAP database {}: it has an image {}, but ids are from 1 to {}",
                 path.string(),
                 id,
                 kMaxImages - 1);
    }
    const auto [entry, is_new] = result.try_emplace(static_cast<ColmapImageId>(id));
    if (!is_new) ThrowError("COLMAP database {}: it has two images {}", path.string(), id);
    ColmapImage& image = entry->second;
    image.name = images.Text(1);
    RequirePictureName(fmt::format("COLMAP database {}", path.string()), image.name);
    const std::int64_t rows = images.Int(2);
    const std::int64_t cols = images.Int(3);
    if (rows != 0 && (cols < 2 || cols > 6)) {
      ThrowError("COLMAP database {}: the keypoints of image {} have {} columns instead of 2, 4, 6",
                 path.string(),
                 image.name,
                 cols);
    }
    if (rows < 0 || rows > kMaxKeypoints) {
      ThrowError("COLMAP database {}: image {} has {} keypoints", path.string(), image.name, rows);
    }
    const auto values = FromBytes<float>(images.Blob(4), rows * cols, path, "keypoints");
    for (std::int64_t i = 0; i < rows; ++i) {
      const float* xy = values.data() + i * cols;
      image.keypoints.emplace_back(xy[0], xy[1]);
    }
  }
  return result;
}

std::optional<Rigid3> ReadPose(const SqliteStatement& statement,
                               int qvec,
                               int tvec,
                               const std::filesystem::path& path) {
  if (statement.Blob(qvec).empty() || statement.Blob(tvec).empty()) return std::nullopt;
  const auto q = FromBytes<double>(statement.Blob(qvec), 4, path, "two_view_geometries");
  const auto t = FromBytes<double>(statement.Blob(tvec), 3, path, "two_view_geometries");
  const Rigid3 pose{{q[0], q[1], q[2], q[3]}, {t[0], t[1], t[2]}};
  // An unset pose in 3.x: zeros, or the identity.
  const bool turns = pose.rotation.vec().norm() > 0.0;
  const bool moves = pose.translation.norm() > 0.0;
  if (pose.rotation.norm() == 0.0 || (!turns && !moves)) return std::nullopt;
  return pose;
}

ColmapTwoViewGeometry ReadGeometry(const SqliteStatement& row, const std::filesystem::path& path) {
  ColmapTwoViewGeometry g;
  g.inliers = FromBytes<ColmapMatch>(row.Blob(2), row.Int(1), path, "two_view_geometries");
  g.config = static_cast<ColmapPairConfig>(row.Int(3));
  g.fundamental = ReadMatrix(row, 4, path);
  g.essential = ReadMatrix(row, 5, path);
  g.homography = ReadMatrix(row, 6, path);
  g.cam2_from_cam1 = ReadPose(row, 7, 8, path);
  return g;
}

std::pair<ColmapImageId, ColmapImageId> ReadPairId(const SqliteStatement& row,
                                                   const std::filesystem::path& path) {
  const std::int64_t id = row.Int(0);
  const auto images = ColmapImagesOfPair(id);
  if (ColmapPairId(images.first, images.second) != id) {
    ThrowError("COLMAP database {}: {} is not the id of a pair of images", path.string(), id);
  }
  return images;
}

std::map<std::pair<ColmapImageId, ColmapImageId>, ColmapPair> ReadPairs(
    SqliteDatabase& db, const std::filesystem::path& path) {
  std::map<std::pair<ColmapImageId, ColmapImageId>, ColmapPair> pairs;
  auto matches = db.Prepare("SELECT pair_id, rows, data FROM matches");
  while (matches.Step()) {
    pairs[ReadPairId(matches, path)].matches =
        FromBytes<ColmapMatch>(matches.Blob(2), matches.Int(1), path, "matches");
  }
  auto geometries = db.Prepare(
      "SELECT pair_id, rows, data, config, F, E, H, qvec, tvec FROM two_view_geometries");
  while (geometries.Step()) {
    pairs[ReadPairId(geometries, path)].geometry = ReadGeometry(geometries, path);
  }
  return pairs;
}

}  // namespace

ColmapImageId ColmapImageIdOf(FrameIndex frame) {
  if (ToInt(frame) >= kMaxImages - 1) {
    ThrowError("frame {} is beyond the {} images that COLMAP can number", ToInt(frame), kMaxImages);
  }
  return ToInt(frame) + 1;
}

FrameIndex FrameOfColmapImage(ColmapImageId id) {
  if (id == 0) ThrowError("COLMAP image id 0 is not one of cohort's: they start at 1");
  return FrameIndex{id - 1};
}

std::int64_t ColmapPairId(ColmapImageId id1, ColmapImageId id2) {
  return kMaxImages * std::min(id1, id2) + std::max(id1, id2);
}

std::pair<ColmapImageId, ColmapImageId> ColmapImagesOfPair(std::int64_t pair_id) {
  return {static_cast<ColmapImageId>((pair_id - pair_id % kMaxImages) / kMaxImages),
          static_cast<ColmapImageId>(pair_id % kMaxImages)};
}

ColmapTwoViewGeometry ColmapTwoViewGeometry::Swapped() const {
  ColmapTwoViewGeometry swapped;
  swapped.config = config;
  swapped.inliers = SwapColumns(inliers);
  if (fundamental) swapped.fundamental = fundamental->transpose();
  if (essential) swapped.essential = essential->transpose();
  if (homography) swapped.homography = homography->inverse();
  if (cam2_from_cam1) swapped.cam2_from_cam1 = cam2_from_cam1->Inverse();
  return swapped;
}

ColmapPair ColmapPair::Swapped() const {
  ColmapPair swapped;
  swapped.matches = SwapColumns(matches);
  if (geometry) swapped.geometry = geometry->Swapped();
  return swapped;
}

void ColmapDatabase::AddPair(ColmapImageId image1, ColmapImageId image2, ColmapPair pair) {
  if (image1 > image2) {
    AddPair(image2, image1, pair.Swapped());
    return;
  }
  const auto first = images.find(image1);
  const auto second = images.find(image2);
  if (image1 == image2 || first == images.end() || second == images.end()) {
    ThrowError("COLMAP database: there is no pair of images {} and {}", image1, image2);
  }
  CheckIndices(pair.matches, first->second, second->second, "COLMAP database");
  CheckMatchedOnce(pair.matches, first->second, second->second, "COLMAP database");
  if (pair.geometry) {
    CheckIndices(pair.geometry->inliers, first->second, second->second, "COLMAP database");
    CheckMatchedOnce(pair.geometry->inliers, first->second, second->second, "COLMAP database");
  }
  if (!pairs.emplace(std::pair(image1, image2), std::move(pair)).second) {
    ThrowError("COLMAP database: the pair of images {} and {} occurs twice", image1, image2);
  }
}

void WriteColmapDatabase(const std::filesystem::path& path, const ColmapDatabase& database) {
  OutputFile out(path);
  {
    auto db = SqliteDatabase::Open(out.partial(), SqliteDatabase::Mode::kCreate);
    // The file is discarded if anything fails, so no journal is needed.
    db.Execute("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF; PRAGMA foreign_keys = ON");
    SqliteTransaction transaction(db);
    db.Execute(kSchema);
    db.Execute("PRAGMA user_version = " + std::to_string(kUserVersion));
    WriteRows(db, database);
    transaction.Commit();
  }
  RemoveJournals(path);  // left by a colmap run
  out.Commit();
}

std::int64_t CountDescribedImages(const std::filesystem::path& path) {
  try {
    auto db = SqliteDatabase::Open(path, SqliteDatabase::Mode::kRead);
    if (!db.HasTable("descriptors")) return 0;
    auto count = db.Prepare("SELECT COUNT(*) FROM descriptors WHERE rows > 0");
    count.Step();
    return count.Int(0);
  } catch (const SystemError&) {
    throw;
  } catch (const Error&) {
    return 0;
  }
}

ColmapDatabase ReadColmapDatabase(const std::filesystem::path& path) {
  auto db = SqliteDatabase::Open(path, SqliteDatabase::Mode::kRead);
  CheckSchema(db, path);
  ColmapDatabase database;
  database.camera = ReadCameras(db, path);
  database.images = ReadImages(db, path);
  database.pairs = ReadPairs(db, path);
  const std::string name = fmt::format("COLMAP database {}", path.string());
  for (const auto& [ids, pair] : database.pairs) {
    const auto first = database.images.find(ids.first);
    const auto second = database.images.find(ids.second);
    if (ids.first >= ids.second || first == database.images.end() ||
        second == database.images.end()) {
      ThrowError("COLMAP database {}: there is no pair of images {} and {}",
                 path.string(),
                 ids.first,
                 ids.second);
    }
    CheckIndices(pair.matches, first->second, second->second, name);
    if (pair.geometry) CheckIndices(pair.geometry->inliers, first->second, second->second, name);
  }
  return database;
}

}  // namespace cohort
