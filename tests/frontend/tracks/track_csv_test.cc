#include "frontend/tracks/track_csv.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>

#include "frontend/core/error.h"
#include "frontend/storage/output.h"
#include "tests/support/child_process.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::ThrowsMessage;

TracksCsv Parse(const std::string& text) {
  const test::TempDir dir;
  WriteBytes(dir / "in.csv", text);
  return ReadTracksCsv(dir / "in.csv");
}

TEST(TracksCsv, ReadsBackWhatWasWrittenToTheLastBit) {
  const test::TempDir dir;
  std::vector<Observation> observations;
  const double values[] = {
      0.1, -3.0, 1.0 / 3.0, 639.49999999999994, 5e-324, 1.7976931348623157e308};
  for (std::uint32_t i = 0; i < 6; ++i) {
    observations.push_back(
        {.feature = FeatureId{UINT32_MAX - i % 2},
         .frame = FrameIndex{UINT32_MAX - i},
         .xy = {values[i], values[5 - i]},
         .state = i % 2 == 0 ? ObservationState::kObserved : ObservationState::kPredicted,
         .residual = values[i]});
  }
  const TrackSet tracks = TrackSet::Build(observations);
  WriteTracksCsv(dir / "a.csv", tracks);
  const TracksCsv csv = ReadTracksCsv(dir / "a.csv");
  EXPECT_TRUE(csv.track_ids.empty());
  ASSERT_EQ(csv.tracks.observations().size(), 6u);
  for (std::size_t i = 0; i < 6; ++i) {
    const Observation& a = tracks.observations()[i];
    const Observation& b = csv.tracks.observations()[i];
    EXPECT_EQ(a.feature, b.feature);
    EXPECT_EQ(a.frame, b.frame);
    EXPECT_EQ(a.xy, b.xy);
    EXPECT_EQ(a.state, b.state);
    EXPECT_EQ(a.residual, b.residual);
  }
}

// As point trackers call it.
TEST(TracksCsv, AColumnOfVisibilityIsTakenForObserved) {
  const auto observed = [](const std::string& column, const std::string& value) {
    const std::string text = "track_id,frame,x,y," + column + "\n1,0,2,3," + value + "\n";
    return Parse(text).tracks.observations()[0].state == ObservationState::kObserved;
  };
  for (const char* column : {"visible", "visibility"}) {
    for (const char* value : {"1", "True", "0.5", "0.9"}) EXPECT_TRUE(observed(column, value));
    for (const char* value : {"0", "false", "0.4"}) EXPECT_FALSE(observed(column, value));
  }
  EXPECT_FALSE(observed("occluded", "1"));
  EXPECT_TRUE(observed("occluded", "0.2"));
  EXPECT_THAT([&] { observed("visible", "yes"); }, ThrowsMessage<Error>(HasSubstr("visible")));
  // What is called observed counts before them, and is 1 or 0.
  EXPECT_THAT([&] { observed("observed", "0.9"); },
              ThrowsMessage<Error>(HasSubstr("neither 1 nor 0")));
  EXPECT_FALSE(observed("visible,observed", "1,0"));
}

TEST(TracksCsv, WritesTheColumnsOfTheContract) {
  const test::TempDir dir;
  WriteTracksCsv(
      dir / "a.csv",
      TrackSet::Build({{.feature = FeatureId{7},
                        .frame = FrameIndex{2},
                        .xy = {0.1, -20.5},
                        .state = ObservationState::kPredicted,
                        .residual = 0.25},
                       {.feature = FeatureId{7}, .frame = FrameIndex{1}, .xy = {3, 4}}}));
  EXPECT_EQ(ReadBytes(dir / "a.csv"),
            "track_id,frame,x,y,observed,residual\n7,1,3,4,1,0\n7,2,0.1,-20.5,0,0.25\n");
}

TEST(TracksCsv, FindsColumnsByNameAndSkipsOthers) {
  const auto tracks = Parse(
                          "\xEF\xBB\xBFnote, y ,frame,\"x\",track_id\r\n"
                          "\"a, b\",2.5, 3 ,1.5,9\r\n"
                          ",4,4,3,9\r\n\r\n")
                          .tracks;
  ASSERT_EQ(tracks.observations().size(), 2u);
  const auto track = tracks.Track(FeatureId{9});
  EXPECT_EQ(track[0].frame, FrameIndex{3});
  EXPECT_EQ(track[0].xy, Eigen::Vector2d(1.5, 2.5));
  EXPECT_EQ(track[0].state, ObservationState::kObserved);
  EXPECT_EQ(track[1].xy, Eigen::Vector2d(3, 4));
  // A last line without its end, and optional columns left empty.
  EXPECT_EQ(Parse("track_id,frame,x,y,observed,residual\n1,1,1,1,False,\n1,2,1,1,,0.5")
                .tracks.CountPredicted(),
            1u);
}

TEST(TracksCsv, MapsIdsBeyond32BitsInTheirOrder) {
  const TracksCsv csv =
      Parse("track_id,frame,x,y\n18446744073709551615,0,1,1\n5,0,2,2\n4294967296,0,3,3\n5,1,4,4\n");
  EXPECT_THAT(csv.track_ids, testing::ElementsAre(5u, 4294967296u, 18446744073709551615u));
  EXPECT_EQ(csv.tracks.Track(FeatureId{0}).size(), 2u);
  EXPECT_EQ(csv.tracks.Track(FeatureId{1})[0].xy.x(), 3.0);
  EXPECT_EQ(csv.tracks.Track(FeatureId{2})[0].xy.x(), 1.0);
}

TEST(TracksCsv, SaysWhichLineIsWrongAndWhy) {
  const std::string header = "track_id,frame,x,y,observed\n1,0,5,5,1\n";
  const std::vector<std::pair<std::string, std::vector<std::string>>> cases{
      {"", {"empty"}},
      {"track_id,frame,x,y\n", {"no rows"}},
      {"track_id,frame,x\n1,2,3\n", {"line 1", "no column y"}},
      {"1,2,3,4\n", {"line 1", "no column track_id"}},
      {"track_id,frame,x,y,x\n", {"line 1", "two columns x"}},
      {header + "1,1,nan,2,1\n", {"line 3", "x is 'nan'"}},
      {header + "1,1,2,-inf,1\n", {"line 3", "y is '-inf'"}},
      {header + "1,1,2,1e999,1\n", {"line 3", "y is '1e999'"}},
      {header + "1,1,2,,1\n", {"line 3", "y is ''"}},
      {header + "1,1,2,3 px,1\n", {"line 3", "y is '3 px'"}},
      {header + "1,-1,2,3,1\n", {"line 3", "frame is '-1'"}},
      {header + "1,1.5,2,3,1\n", {"line 3", "frame is '1.5'"}},
      {header + "1,4294967296,2,3,1\n", {"line 3", "frame is '4294967296'"}},
      {header + "-1,1,2,3,1\n", {"line 3", "track_id is '-1'"}},
      {header + "a,1,2,3,1\n", {"line 3", "track_id is 'a'"}},
      {header + "1,1,2,3,2\n", {"line 3", "observed is '2'"}},
      {header + "1,1,2,3\n", {"line 3", "4 fields", "names 5"}},
      {header + "1,1,2,3,1,1\n", {"line 3", "6 fields"}},
      {header + "\n1,1,2,3,1\n", {"line 4", "blank line"}},
      {header + "2,0,1,1,1\n1,0,6,6,1\n",
       {"line 4", "track 1 already has a position in frame 0, at line 2"}},
      {header + std::string(70'000, 'x'), {"line 3", "longer than"}}};
  const test::TempDir dir;
  for (const auto& [text, parts] : cases) {
    WriteBytes(dir / "in.csv", text);
    std::string message = "no error";
    try {
      ReadTracksCsv(dir / "in.csv");
    } catch (const Error& error) {
      message = error.what();
    }
    EXPECT_THAT(message, HasSubstr("in.csv")) << text.substr(0, 200);
    EXPECT_THAT(message, testing::Not(HasSubstr("\n")));
    for (const std::string& part : parts) EXPECT_THAT(message, HasSubstr(part));
  }
  EXPECT_THAT([&] { ReadTracksCsv(dir / "missing.csv"); },
              ThrowsMessage<Error>(HasSubstr("missing.csv")));
  EXPECT_THAT([&] { ReadTracksCsv(dir.path()); }, ThrowsMessage<Error>(HasSubstr("folder")));
}

TEST(TracksCsv, AFullDiskIsOneErrorAndTheOldFileStays) {
  const test::TempDir dir;
  std::vector<Observation> observations;
  for (std::uint32_t f = 0; f < 20'000; ++f) observations.push_back({.feature = FeatureId{f}});
  const TrackSet tracks = TrackSet::Build(observations);
  WriteBytes(dir / "a.csv", "old");
  EXPECT_THAT(test::RunInChild([&] {
                std::signal(SIGXFSZ, SIG_IGN);
                const rlimit limit{100'000, 100'000};
                if (setrlimit(RLIMIT_FSIZE, &limit) != 0) return std::string("no limit");
                WriteTracksCsv(dir / "a.csv", tracks);
                return std::string("written");
              }),
              AllOf(HasSubstr("threw: cannot write"), HasSubstr("a.csv")));
  EXPECT_EQ(ReadBytes(dir / "a.csv"), "old");
  EXPECT_FALSE(fs::exists(dir / "a.csv.partial"));
}

}  // namespace
}  // namespace cohort
