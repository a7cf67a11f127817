#include "frontend/tracks/track_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <sys/resource.h>

#include <atomic>
#include <csignal>
#include <fstream>
#include <functional>
#include <limits>
#include <thread>

#include "frontend/core/error.h"
#include "frontend/storage/output.h"
#include "frontend/storage/sqlite.h"
#include "tests/support/cameras.h"
#include "tests/support/child_process.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

constexpr std::uint32_t kFeatures = 50;

TrackFile Header() {
  TrackFile header;
  header.source = "/clips/dark.mp4";
  header.image_root = "";
  header.width_px = 640;
  header.height_px = 480;
  header.camera = Camera{.width_px = 640,
                         .height_px = 480,
                         .fx = 0.1,
                         .fy = 500.25,
                         .cx = 319.5,
                         .cy = 239.5,
                         .k1 = -0.3,
                         .known = false,
                         .guess_log_sigma = 0.05};
  header.meta = {.tracker = "subspace",
                 .options = "{\"a\": \"b'c\"}",
                 .no_second_pass = "too few tracks",
                 .cuts = {FrameIndex{3}, FrameIndex{8}},
                 .row_order = RowOrder::kLeft,
                 .other = {{"weather", "rain"}}};
  return header;
}

FrameInfo Info(std::uint32_t frame) {
  return {.index = FrameIndex{frame},
          .name = "frame" + std::to_string(frame) + ".png",
          .timestamp_ns = std::int64_t{1'700'000'000'000'000'000} + frame};
}

std::vector<Observation> ObservationsOf(std::uint32_t frame) {
  std::vector<Observation> observations;
  for (std::uint32_t f = 0; f < kFeatures; ++f) {
    Observation o{.feature = FeatureId{f},
                  .frame = FrameIndex{frame},
                  .xy = {f + 0.1 * frame, 1.0 / (1.0 + f)},
                  .state = f % 3 == 0 ? ObservationState::kPredicted : ObservationState::kObserved,
                  .residual = 1e-3 * f};
    if (f % 2 == 0) o.covariance = PixelCovariance{.xx = 0.1F, .xy = -0.01F, .yy = 1e-3F};
    observations.push_back(o);
  }
  return observations;
}

TrackFile Example(std::uint32_t frames) {
  TrackFile file = Header();
  std::vector<Observation> all;
  for (std::uint32_t frame = 0; frame < frames; ++frame) {
    file.frames.push_back(Info(frame));
    const auto observations = ObservationsOf(frame);
    all.insert(all.end(), observations.begin(), observations.end());
  }
  file.frames.push_back(Info(frames + 7));  // a gap, and a frame without observations
  file.tracks = TrackSet::Build(all,
                                {{FeatureId{3}, FrameIndex{1}, LossReason::kContradicted},
                                 {FeatureId{9}, FrameIndex{0}, LossReason::kMasked}});
  return file;
}

void ExpectSame(const std::optional<Camera>& a, const std::optional<Camera>& b) {
  ASSERT_EQ(a.has_value(), b.has_value());
  if (a) {
    EXPECT_EQ(a->width_px, b->width_px);
    EXPECT_EQ(a->fx, b->fx);
    EXPECT_EQ(a->cy, b->cy);
    EXPECT_EQ(a->k1, b->k1);
    EXPECT_EQ(a->p2, b->p2);
    EXPECT_EQ(a->k3, b->k3);
    EXPECT_EQ(a->k4, b->k4);
    EXPECT_EQ(a->k5, b->k5);
    EXPECT_EQ(a->k6, b->k6);
    EXPECT_EQ(a->model, b->model);
    EXPECT_EQ(a->known, b->known);
    EXPECT_EQ(a->guess_log_sigma, b->guess_log_sigma);
  }
}

void ExpectSame(const TrackFile& a, const TrackFile& b) {
  EXPECT_EQ(a.source, b.source);
  EXPECT_EQ(a.image_root, b.image_root);
  EXPECT_EQ(a.width_px, b.width_px);
  EXPECT_EQ(a.height_px, b.height_px);
  EXPECT_EQ(a.meta, b.meta);
  ExpectSame(a.camera, b.camera);
  ExpectSame(a.found_camera, b.found_camera);
  ASSERT_EQ(a.frames.size(), b.frames.size());
  for (std::size_t i = 0; i < a.frames.size(); ++i) {
    EXPECT_EQ(a.frames[i].index, b.frames[i].index);
    EXPECT_EQ(a.frames[i].name, b.frames[i].name);
    EXPECT_EQ(a.frames[i].timestamp_ns, b.frames[i].timestamp_ns);
  }
  ASSERT_EQ(a.tracks.observations().size(), b.tracks.observations().size());
  for (std::size_t i = 0; i < a.tracks.observations().size(); ++i) {
    const Observation& p = a.tracks.observations()[i];
    const Observation& q = b.tracks.observations()[i];
    EXPECT_EQ(p.feature, q.feature);
    EXPECT_EQ(p.frame, q.frame);
    EXPECT_EQ(p.xy, q.xy);
    EXPECT_EQ(p.state, q.state);
    EXPECT_EQ(p.residual, q.residual);
    ASSERT_EQ(p.covariance.has_value(), q.covariance.has_value());
    if (p.covariance) {
      EXPECT_EQ(p.covariance->xx, q.covariance->xx);
      EXPECT_EQ(p.covariance->xy, q.covariance->xy);
      EXPECT_EQ(p.covariance->yy, q.covariance->yy);
    }
  }
  ASSERT_EQ(a.tracks.ends().size(), b.tracks.ends().size());
  for (std::size_t i = 0; i < a.tracks.ends().size(); ++i) {
    EXPECT_EQ(a.tracks.ends()[i].feature, b.tracks.ends()[i].feature);
    EXPECT_EQ(a.tracks.ends()[i].last_frame, b.tracks.ends()[i].last_frame);
    EXPECT_EQ(a.tracks.ends()[i].reason, b.tracks.ends()[i].reason);
  }
}

std::vector<std::string> NamesIn(const fs::path& folder) {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(folder)) names.push_back(entry.path().filename());
  std::sort(names.begin(), names.end());
  return names;
}

TEST(TrackStore, ReadsBackWhatWasWrittenToTheLastBit) {
  const test::TempDir dir;
  const TrackFile file = Example(4);
  WriteTrackFile(dir / "a.tracks", file);
  ExpectSame(ReadTrackFile(dir / "a.tracks"), file);
  EXPECT_THAT(NamesIn(dir.path()), testing::ElementsAre("a.tracks"));

  TrackFile bare;
  WriteTrackFile(dir / "bare.tracks", bare);
  ExpectSame(ReadTrackFile(dir / "bare.tracks"), bare);
}

TEST(TrackStore, HoldsTheFramesThatRepeatOthers) {
  const test::TempDir dir;
  TrackFile file = Example(3);
  file.repeats = {{Info(3), FrameIndex{2}}, {Info(4), FrameIndex{2}}};
  WriteTrackFile(dir / "a.tracks", file);
  const TrackFile read = ReadTrackFile(dir / "a.tracks");
  EXPECT_EQ(read.FrameCount(), file.frames.size() + 2);
  ASSERT_EQ(read.repeats.size(), 2U);
  EXPECT_EQ(read.repeats[1].frame.index, FrameIndex{4});
  EXPECT_EQ(read.repeats[1].frame.name, Info(4).name);
  EXPECT_EQ(read.repeats[1].frame.timestamp_ns, Info(4).timestamp_ns);
  EXPECT_EQ(read.repeats[1].original, FrameIndex{2});

  file.repeats = {{Info(2), FrameIndex{1}}};  // which is a frame of its own
  WriteTrackFile(dir / "a.tracks", file);
  EXPECT_THAT([&] { ReadTrackFile(dir / "a.tracks"); },
              ThrowsMessage<Error>(HasSubstr("its frame 2 cannot repeat frame 1")));
}

TEST(TrackStore, HoldsCamerasOfAllModels) {
  const test::TempDir dir;
  TrackFile file = Example(1);
  for (const Camera& camera :
       {test::FreiburgCamera(), test::RationalCamera(), test::FisheyeCamera()}) {
    file.camera = camera;
    file.found_camera = camera;
    file.found_camera->known = false;
    file.found_camera->width_px = file.width_px;
    file.found_camera->height_px = file.height_px;
    WriteTrackFile(dir / "a.tracks", file);
    ExpectSame(ReadTrackFile(dir / "a.tracks"), file);
  }
  SqliteDatabase::Open(dir / "a.tracks", SqliteDatabase::Mode::kCreate)
      .Execute("UPDATE camera SET model = 'mirror'");
  EXPECT_THAT([&] { ReadTrackFile(dir / "a.tracks"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("a.tracks"), HasSubstr("'mirror'"))));
}

TEST(TrackStore, NamesAFileThatIsMissingForeignOrDamaged) {
  const test::TempDir dir;
  EXPECT_THAT([&] { ReadTrackFile(dir / "missing.tracks"); },
              ThrowsMessage<Error>(HasSubstr("missing.tracks")));
  EXPECT_THAT([&] { ReadTrackFile(dir.path()); }, ThrowsMessage<Error>(HasSubstr("not a file")));
  WriteBytes(dir / "text.tracks", std::string(5000, 'x'));
  EXPECT_THAT([&] { ReadTrackFile(dir / "text.tracks"); },
              ThrowsMessage<Error>(HasSubstr("text.tracks")));
  WriteBytes(dir / "empty.tracks", "");
  EXPECT_THAT([&] { ReadTrackFile(dir / "empty.tracks"); },
              ThrowsMessage<Error>(HasSubstr("is not a .tracks file")));
  {
    auto db = SqliteDatabase::Open(dir / "other.db", SqliteDatabase::Mode::kCreate);
    db.Execute("CREATE TABLE t(a)");
  }
  EXPECT_THAT([&] { ReadTrackFile(dir / "other.db"); },
              ThrowsMessage<Error>(HasSubstr("other.db is not a .tracks file")));

  WriteTrackFile(dir / "cut.tracks", Example(20));
  fs::resize_file(dir / "cut.tracks", fs::file_size(dir / "cut.tracks") / 2);
  EXPECT_THAT([&] { ReadTrackFile(dir / "cut.tracks"); },
              ThrowsMessage<Error>(AllOf(HasSubstr("cut.tracks"), HasSubstr("malformed"))));
  const std::map<std::string, std::string> damages{
      {"UPDATE observations SET frame = 99 WHERE frame = 0", "frame 99"},
      {"UPDATE observations SET track_id = -1 WHERE track_id = 0", "track -1"},
      {"UPDATE observations SET x = 9e999 WHERE track_id = 0", "not finite"},
      {"INSERT INTO ends VALUES(4, 1, 'tired')", "'tired'"},
      {"UPDATE meta SET value = 'wide' WHERE key = 'width_px'", "'wide'"},
      {"DELETE FROM meta WHERE key = 'source'", "source"},
      {"DROP TABLE camera", "camera"},
      {"UPDATE camera SET guess_log_sigma = 0", "uncertainty"},
      {"UPDATE camera SET guess_log_sigma = 9e999", "not finite"},
      {"CREATE TABLE found_camera AS SELECT * FROM camera; UPDATE found_camera SET width_px = 7",
       "the camera that was found"},
      {"PRAGMA user_version = 7", "version 7"}};
  for (const auto& [sql, message] : damages) {
    WriteTrackFile(dir / "bad.tracks", Example(2));
    SqliteDatabase::Open(dir / "bad.tracks", SqliteDatabase::Mode::kCreate).Execute(sql);
    EXPECT_THAT([&] { ReadTrackFile(dir / "bad.tracks"); },
                ThrowsMessage<Error>(AllOf(HasSubstr("bad.tracks"), HasSubstr(message))))
        << sql;
  }
}

TEST(TrackStore, AFolderThatMayNotBeWrittenIsNamedAndTheOldFileStays) {
  const test::TempDir dir;
  fs::create_directory(dir / "locked");
  const fs::path path = dir / "locked/a.tracks";
  WriteTrackFile(path, Example(2));
  fs::permissions(dir.path(), fs::perms(0755));
  fs::permissions(path, fs::perms(0444));
  fs::permissions(dir / "locked", fs::perms(0555));
  for (const std::string name : {"a.tracks", "new.tracks"}) {
    const fs::path target = dir / "locked" / name;
    EXPECT_THAT(test::RunInChild([&] {
                  test::DropRoot();
                  WriteTrackFile(target, Example(3));
                  return "written";
                }),
                AllOf(HasSubstr("threw: cannot write"), HasSubstr(target.string())));
  }
  // What may only be read is still read.
  EXPECT_EQ(test::RunInChild([&] {
              test::DropRoot();
              return std::to_string(ReadTrackFile(path).frames.size());
            }),
            "3");
  EXPECT_THAT(NamesIn(dir / "locked"), testing::ElementsAre("a.tracks"));
  fs::permissions(dir / "locked", fs::perms(0755));
  EXPECT_THAT([&] { WriteTrackFile(dir / "nowhere/a.tracks", Example(1)); },
              ThrowsMessage<Error>(HasSubstr("nowhere")));
  EXPECT_THAT([&] { WriteTrackFile(dir / "locked", Example(1)); },
              ThrowsMessage<Error>(HasSubstr("it is a folder")));
}

// A file that may not grow behaves as on a full disk.
void LimitFileSize(rlim_t bytes) {
  std::signal(SIGXFSZ, SIG_IGN);
  const rlimit limit{bytes, bytes};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
}

TEST(TrackStore, AFullDiskIsOneErrorAndTheOldFileStays) {
  const test::TempDir dir;
  const fs::path path = dir / "a.tracks";
  const TrackFile old = Example(2);
  WriteTrackFile(path, old);
  EXPECT_THAT(test::RunInChild([&] {
                LimitFileSize(200'000);
                WriteTrackFile(path, Example(1000));
                return "written";
              }),
              AllOf(HasSubstr("threw: "), HasSubstr("a.tracks.partial"), HasSubstr("disk")));
  ExpectSame(ReadTrackFile(path), old);
  EXPECT_THAT(NamesIn(dir.path()), testing::ElementsAre("a.tracks"));
}

TEST(TrackStore, ASmallDiskThatFillsUpIsOneError) {
  const test::TempDir dir;
  fs::create_directory(dir / "disk");
  if (mount("tmpfs", (dir / "disk").c_str(), "tmpfs", 0, "size=300k") != 0) {
    GTEST_SKIP() << "needs the right to mount";
  }
  const fs::path path = dir / "disk/a.tracks";
  std::string message = "written";
  try {
    WriteTrackFile(path, Example(1000));
  } catch (const Error& error) {
    message = error.what();
  }
  EXPECT_THAT(message, AllOf(HasSubstr("a.tracks.partial: "), HasSubstr("disk")));
  EXPECT_TRUE(fs::is_empty(dir / "disk"));
  EXPECT_EQ(umount((dir / "disk").c_str()), 0);
}

// A view in the place of a table.
constexpr const char* kEndlessRows =
    "DROP TABLE observations; CREATE VIEW observations AS WITH RECURSIVE c(n) AS "
    "(SELECT 0 UNION ALL SELECT n + 1 FROM c) SELECT 0 AS frame, n AS track_id, 1.0 AS x, "
    "1.0 AS y, 1 AS observed, 0.0 AS residual, NULL AS cov_xx, NULL AS cov_xy, NULL AS cov_yy "
    "FROM c";

TEST(TrackStore, TakesNothingThatCannotBe) {
  const test::TempDir dir;
  for (const char* lie :
       {"UPDATE camera SET fx = 0",
        "UPDATE camera SET fy = -1",
        "UPDATE camera SET cx = 9e999",
        "UPDATE camera SET width_px = 1 << 32",
        "UPDATE camera SET height_px = -5",
        "UPDATE meta SET value = '2000000000' WHERE key = 'width_px'",
        "UPDATE meta SET value = '0' WHERE key = 'width_px'",
        "UPDATE observations SET x = 9e999 WHERE track_id = 1",
        "UPDATE observations SET track_id = 1 << 33 WHERE track_id = 1",
        "UPDATE observations SET cov_xx = 9e999, cov_xy = 0, cov_yy = 1 WHERE track_id = 1",
        "UPDATE observations SET cov_xx = -1, cov_xy = 0, cov_yy = 1 WHERE track_id = 1",
        "UPDATE observations SET cov_xx = 0, cov_xy = 0, cov_yy = 0 WHERE track_id = 1",
        "UPDATE observations SET cov_xx = 1, cov_xy = 1, cov_yy = 1 WHERE track_id = 1",
        "UPDATE observations SET residual = 9e999 WHERE track_id = 1",
        "UPDATE frames SET name = '../../x.png' WHERE \"index\" = 1",
        "UPDATE frames SET name = '/etc/passwd' WHERE \"index\" = 1",
        "UPDATE frames SET name = 'a' || char(10) || 'b' WHERE \"index\" = 1",
        "UPDATE frames SET name = 'a' || char(27) || '[31m' WHERE \"index\" = 1",
        kEndlessRows}) {
    WriteTrackFile(dir / "a.tracks", Example(2));
    SqliteDatabase::Open(dir / "a.tracks", SqliteDatabase::Mode::kCreate).Execute(lie);
    EXPECT_THAT([&] { ReadTrackFile(dir / "a.tracks"); },
                ThrowsMessage<Error>(HasSubstr("a.tracks")))
        << lie;
  }
}

// An edge may give an ellipse so long that floats have none: it is written as one that they have.
TEST(TrackStore, TakesEveryCovarianceThatIsOneBeforeItIsRounded) {
  for (const double xy : {1.0 - 1e-12, -1.0 + 1e-9, 0.5}) {
    TrackFile file = Example(2);
    const auto before = file.tracks.observations();
    std::vector<Observation> observations(before.begin(), before.end());
    observations[0].covariance = PixelCovariance::From(0.1 * Eigen::Matrix2d{{1.0, xy}, {xy, 1.0}});
    file.tracks = TrackSet::Build(observations);
    const test::TempDir dir;
    WriteTrackFile(dir / "a.tracks", file);
    const auto read = ReadTrackFile(dir / "a.tracks").tracks.observations()[0].covariance;
    ASSERT_TRUE(read) << xy;
    EXPECT_NEAR(read->xy, 0.1 * xy, 2e-7);
    EXPECT_EQ(read->xx, 0.1F);
  }
}

}  // namespace
}  // namespace cohort
