#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include "frontend/tracks/track_csv.h"
#include "frontend/tracks/track_store.h"
#include "tests/support/child_process.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

constexpr std::uint32_t kFrames = 1000;
constexpr std::uint32_t kTracks = 1000;

long PeakMegabytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss / 1024;
}

TEST(TracksCsv, AMillionRowsGoInAndOutWithinBoundedMemory) {
  const test::TempDir dir;
  const std::string report = test::RunInChild([&] {
    const long before = PeakMegabytes();
    TrackFile file;
    file.width_px = file.height_px = 2000;
    {
      std::vector<Observation> observations;
      observations.reserve(kFrames * kTracks);
      for (std::uint32_t frame = 0; frame < kFrames; ++frame) {
        file.frames.push_back({FrameIndex{frame}, std::to_string(frame), 0});
        for (std::uint32_t track = 0; track < kTracks; ++track) {
          observations.push_back({.feature = FeatureId{track},
                                  .frame = FrameIndex{frame},
                                  .xy = {track + frame / 7.0, frame + track / 3.0},
                                  .residual = 1.0 / (1 + track)});
        }
      }
      WriteTracksCsv(dir / "a.csv", TrackSet::Build(std::move(observations)));
    }
    file.tracks = ReadTracksCsv(dir / "a.csv").tracks;
    WriteTrackFile(dir / "a.tracks", file);
    return fmt::format("{} rows, bounded: {}",
                       file.tracks.observations().size(),
                       PeakMegabytes() - before < 200 ? "yes" : std::to_string(PeakMegabytes()));
  });
  EXPECT_EQ(report, "1000000 rows, bounded: yes");
  const TrackFile file = ReadTrackFile(dir / "a.tracks");
  EXPECT_EQ(file.tracks.features().size(), kTracks);
  EXPECT_EQ(file.tracks.Find(FeatureId{10}, FrameIndex{500})->xy,
            Eigen::Vector2d(10 + 500 / 7.0, 500 + 10 / 3.0));
}

}  // namespace
}  // namespace cohort
