#include "frontend/tracks/opensfm_tracks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "frontend/core/error.h"
#include "frontend/storage/output.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

TEST(OpenSfmTracks, NormalisesByTheLongerSideAboutTheCentre) {
  const test::TempDir dir;
  TrackFile file;
  file.width_px = 640;
  file.height_px = 480;
  file.frames = {{FrameIndex{0}, "a.png", 0}, {FrameIndex{5}, "b.png", 0}};
  file.tracks =
      TrackSet::Build({{.feature = FeatureId{3}, .frame = FrameIndex{0}, .xy = {319.5, 239.5}},
                       {.feature = FeatureId{8}, .frame = FrameIndex{0}, .xy = {639.5, -0.5}},
                       {.feature = FeatureId{8}, .frame = FrameIndex{5}, .xy = {-0.5, 479.5}},
                       {.feature = FeatureId{3},
                        .frame = FrameIndex{5},
                        .xy = {319.5, 239.5},
                        .state = ObservationState::kPredicted},
                       {.feature = FeatureId{9},
                        .frame = FrameIndex{5},
                        .xy = {319.5, 239.5},
                        .state = ObservationState::kPredicted}});
  EXPECT_EQ(WriteOpenSfmTracks(dir / "tracks.csv", file), 2u);
  EXPECT_EQ(ReadBytes(dir / "tracks.csv"),
            "OPENSFM_TRACKS_VERSION_v2\n"
            "a.png\t3\t0\t0\t0\t0.0015625\t0\t0\t0\t-1\t-1\n"
            "a.png\t8\t1\t0.5\t-0.375\t0.0015625\t0\t0\t0\t-1\t-1\n"
            "b.png\t8\t0\t-0.5\t0.375\t0.0015625\t0\t0\t0\t-1\t-1\n");
}

const std::vector<FrameInfo> kFrames = {
    {FrameIndex{0}, "a.png", 0}, {FrameIndex{3}, "b.png", 0}, {FrameIndex{4}, "c.png", 0}};

ImportedTracks Read(const std::string& text) {
  const test::TempDir dir;
  WriteBytes(dir / "tracks.csv", text);
  return ReadOpenSfmTracks(dir / "tracks.csv", kFrames, 640, 480);
}

TEST(OpenSfmTracks, AllVersionsGiveThePixelsThatTheyMean) {
  const std::string zero = "a.png\t12\t0\t0\t0\t9\t9\t9\nb.png\t12\t5\t-0.25\t0.125\t1\t2\t3\n";
  const std::string one =
      "OPENSFM_TRACKS_VERSION_v1\n"
      "a.png\t12\t0\t0\t0\t0.001\t9\t9\t9\nb.png\t12\t5\t-0.25\t0.125\t0.001\t1\t2\t3\n";
  const std::string two =
      "OPENSFM_TRACKS_VERSION_v2\n"
      "a.png\t12\t0\t0\t0\t0.001\t9\t9\t9\t-1\t-1\n"
      "b.png\t12\t5\t-0.25\t0.125\t1e-3\t1\t2\t3\t-1\t-1\n";
  for (const std::string& text : {zero, one, two}) {
    const TrackSet tracks = Read(text).tracks;
    ASSERT_EQ(tracks.observations().size(), 2u) << text;
    EXPECT_EQ(tracks.Find(FeatureId{12}, FrameIndex{0})->xy, Eigen::Vector2d(319.5, 239.5));
    EXPECT_EQ(tracks.Find(FeatureId{12}, FrameIndex{3})->xy, Eigen::Vector2d(159.5, 319.5));
  }
}

TEST(OpenSfmTracks, ReadsBackWhatWasWritten) {
  const test::TempDir dir;
  TrackFile file;
  file.width_px = 480;
  file.height_px = 640;
  file.frames = kFrames;
  std::vector<Observation> observations;
  for (std::uint32_t i = 0; i < 30; ++i) {
    observations.push_back({.feature = FeatureId{i / 3},
                            .frame = kFrames[i % 3].index,
                            .xy = {14.7 * i + 0.1, 639.0 - 13.3 * i}});
  }
  file.tracks = TrackSet::Build(std::move(observations));
  WriteOpenSfmTracks(dir / "tracks.csv", file);
  const TrackSet read = ReadOpenSfmTracks(dir / "tracks.csv", kFrames, 480, 640).tracks;
  ASSERT_EQ(read.observations().size(), 30u);
  for (const Observation& o : file.tracks.observations()) {
    EXPECT_LT((read.Find(o.feature, o.frame)->xy - o.xy).norm(), 1e-9);
  }
}

TEST(OpenSfmTracks, ImagesThatAreNoFrameAreCounted) {
  const std::string row = "\t1\t0\t0\t0\t9\t9\t9\n";
  const ImportedTracks some = Read("x.png" + row + "images/b.png" + row + "y.png" + row);
  EXPECT_EQ(some.unknown_images, 2u);
  EXPECT_EQ(some.an_unknown_image, "x.png");
  EXPECT_EQ(some.tracks.observations().size(), 1u);
  EXPECT_THAT([&] { Read("x.png" + row); },
              ThrowsMessage<Error>(AllOf(
                  HasSubstr("none of its 1 images"), HasSubstr("x.png"), HasSubstr("a.png"))));
  EXPECT_THAT([&] { Read("l/a.png" + row + "r/a.png" + row); },
              ThrowsMessage<Error>(AllOf(HasSubstr("l/a.png"), HasSubstr("r/a.png"))));
}

TEST(OpenSfmTracks, NamesTheLineThatItCannotUse) {
  const std::string row = "a.png\t1\t0\t0\t0\t9\t9\t9\n";
  const std::pair<std::string, std::vector<std::string>> cases[] = {
      {"", {"is empty"}},
      {"OPENSFM_TRACKS_VERSION_v3\n", {"line 1", "version '3'"}},
      {"OPENSFM_TRACKS_VERSION_v\n", {"line 1", "version ''"}},
      {"OPENSFM_TRACKS_VERSION_v1\n", {"no rows"}},
      {"OPENSFM_TRACKS_VERSION_v1\n" + row, {"line 2", "8 fields", "has 9"}},
      {row + "a.png\t2\t0\tnan\t0\t9\t9\t9\n", {"line 2", "x is 'nan'"}},
      {row + "a.png\tm\t0\t0\t0\t9\t9\t9\n", {"line 2", "track_id is 'm'"}},
      {row + "z.png\t1\t0\t0\t0\t9\t9\t9\n" + row,
       {"line 3", "track 1 already has a position in frame 0, at line 1"}}};
  for (const auto& [text, parts] : cases) {
    std::string message = "no error";
    try {
      Read(text);
    } catch (const Error& error) {
      message = error.what();
    }
    EXPECT_THAT(message, HasSubstr("tracks.csv"));
    for (const std::string& part : parts) EXPECT_THAT(message, HasSubstr(part));
  }
}

}  // namespace
}  // namespace cohort
