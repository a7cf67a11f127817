// What `cohort reconstruct --backend colmap` makes of its options, told by a program in COLMAP's
// place: the mapper itself would take its time (reconstruct_colmap_test.cc runs it).
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <nlohmann/json.hpp>

#include "tests/support/program.h"
#include "tests/support/synthetic_tracks.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class ReconstructCommand : public testing::Test {
 protected:
  ReconstructCommand() {
    test::SyntheticTracksOptions small;
    small.frames = 6;
    WriteTrackFile(Path("a.tracks"), MakeSyntheticTracks(small).file);
    WriteFake("3.8", "random_seed Mapper.ba_global_images_ratio");
  }

  // Knows every option that a command of COLMAP may be given, and registers nothing.
  void WriteFake(const std::string& version,
                 const std::string& own_options,
                 const std::string& last_words = "") {
    WriteBytes(Path("fake"),
               "#!/bin/sh\n"
               "case \"$*\" in\n"
               "'-h') echo COLMAP " +
                   version +
                   " ;;\n"
                   "*-h) for o in database_path image_path output_path Mapper.num_threads "
                   "Mapper.min_num_matches Mapper.init_image_id1 " +
                   own_options +
                   "; do echo \"  --$o arg\"; done ;;\n"
                   "*) echo '" +
                   last_words +
                   "' ;;\n"
                   "esac\n");
    fs::permissions(Path("fake"), fs::perms::owner_all);
  }

  std::string Path(const std::string& name) const { return dir_ / name; }

  // Runs the command, and returns what the program in COLMAP's place was asked to do.
  std::string Log(const std::string& more) {
    end_ = test::RunCohort("reconstruct " + Path("a.tracks") +
                           " --backend colmap --no-write-frames --no-ceres-start --quiet --out " +
                           Path("m") + " --colmap-program " + Path("fake") + " " + more);
    EXPECT_TRUE(fs::exists(Path("m/colmap/colmap.log"))) << end_.err;
    return ReadBytes(Path("m/colmap/colmap.log"));
  }

  static int Count(const std::string& text, const std::string& part) {
    int count = 0;
    for (auto at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
    return count;
  }

  test::TempDir dir_;
  test::ProgramEnd end_;
};

// Whose readout other programs are to know, too: `export --global-shutter --model m/other_parts/1`.
TEST_F(ReconstructCommand, EveryPartOfAClipSaysItsShutter) {
  test::SyntheticTracksOptions options;
  options.frames = 40;
  TrackFile file = MakeSyntheticTracks(options).file;
  std::vector<Observation> observations(file.tracks.observations().begin(),
                                        file.tracks.observations().end());
  for (Observation& o : observations) {  // after frame 25 nothing is the feature that it was
    if (ToInt(o.frame) > 25) o.feature = FeatureId{ToInt(o.feature) + 100'000};
  }
  file.tracks = TrackSet::Build(std::move(observations));
  WriteTrackFile(Path("broken.tracks"), file);
  test::RunCohort("reconstruct " + Path("broken.tracks") + " --ceres.readout 0.4 --quiet --out " +
                  Path("m"));
  const auto part = nlohmann::json::parse(ReadBytes(Path("m/other_parts/1/summary.json")));
  EXPECT_EQ(part["readout"], 0.4);
  EXPECT_EQ(part["row_order"], "down");
  EXPECT_EQ(part["registered"], 14);
  EXPECT_EQ(part["frames"], 14);
  EXPECT_EQ(part["frame_range"], "26:40:1");
  EXPECT_EQ(part["failed"], false);
  EXPECT_GT(part["points"], 100);
}

TEST_F(ReconstructCommand, ColmapGetsTheOptionsOfTheCommand) {
  EXPECT_THAT(Log(""),
              AllOf(HasSubstr(" --random_seed 0 "),
                    HasSubstr(" --Mapper.num_threads 1 "),
                    HasSubstr(" --Mapper.min_num_matches 15 "),
                    HasSubstr(" --Mapper.ba_global_images_ratio 1.4 ")));
  const std::string log =
      Log("--seed 7 --colmap.threads 2 --no-colmap.fewer-adjustments --colmap.max-attempts 1 "
          "--colmap.database.two-view.min-inliers 11");
  EXPECT_THAT(log,
              AllOf(HasSubstr(" --random_seed 7 "),
                    HasSubstr(" --Mapper.num_threads 2 "),
                    HasSubstr(" --Mapper.min_num_matches 11 "),
                    Not(HasSubstr("ba_global_images_ratio"))));
  // The best pair of ours, and then a pair of COLMAP's own.
  EXPECT_EQ(Count(log, "$ " + Path("fake") + " mapper "), 2);
  EXPECT_EQ(Count(log, "--Mapper.init_image_id1"), 1);
}

// tests/colmap_versions/check runs the real ones.
TEST_F(ReconstructCommand, NewerColmapsGetTheOptionsByTheirNewNames) {
  WriteFake("4.2.1", "default_random_seed Mapper.ba_global_frames_ratio");
  EXPECT_THAT(Log("--seed 7"),
              AllOf(HasSubstr(" --default_random_seed 7 "),
                    HasSubstr(" --Mapper.ba_global_frames_ratio 1.4 ")));
}

TEST_F(ReconstructCommand, SaysWhatNewerColmapsSay) {
  for (const auto& [words, meaning] :
       {std::pair("] No images with matches", "no images with matches"),
        std::pair("] Provided pair is insuitable for intialization.",
                  "the initial pair was refused"),
        std::pair("] => Provided pair is unsuitable for initialization.",
                  "the initial pair was refused")}) {
    WriteFake("4.2.1", "", words);
    Log("");
    EXPECT_THAT(end_.err, HasSubstr(std::string("registered no frame: ") + meaning)) << words;
  }
}

TEST_F(ReconstructCommand, SaysInOneLineThatColmapRegisteredNothingAndWhereItsLogIs) {
  Log("");
  EXPECT_EQ(end_.exit_code, 1);
  EXPECT_EQ(Count(end_.err, "\n"), 1) << end_.err;
  EXPECT_THAT(end_.err,
              AllOf(testing::StartsWith("cohort: error: the reconstruction failed: 0 of 6 frames"),
                    HasSubstr("COLMAP 3.8 registered no frame: exit code 0; see colmap.log"),
                    // Not in the folder that the run had while it lasted.
                    HasSubstr("partial results are in " + Path("m") + "\n"),
                    Not(HasSubstr(".partial"))));
  EXPECT_TRUE(fs::exists(Path("m/colmap/colmap.log")));
  const auto summary = nlohmann::json::parse(ReadBytes(Path("m/summary.json")));
  EXPECT_EQ(summary["backend"], "colmap");
  EXPECT_EQ(summary["registered"], 0);
  EXPECT_EQ(summary["failed"], true);
}

TEST_F(ReconstructCommand, ThatIsGivenAPipeSaysThatItIsOne) {
  ASSERT_EQ(mkfifo(Path("pipe").c_str(), 0600), 0);
  const test::ProgramEnd end =
      test::RunCohort("reconstruct " + Path("pipe") + " --quiet --out " + Path("m"));
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_EQ(end.err,
            "cohort: error: cannot read " + Path("pipe") +
                ": it is a pipe, a socket or a device, not a file\n");
}

TEST_F(ReconstructCommand, SaysHowToDoWithoutAVideoThatIsGone) {
  const test::ProgramEnd end =
      test::RunCohort("reconstruct " + Path("a.tracks") + " --backend colmap --quiet --out " +
                      Path("m") + " --colmap-program " + Path("fake"));
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_THAT(end.err, AllOf(HasSubstr("no longer exists"), HasSubstr("--no-write-frames")));
  EXPECT_FALSE(fs::exists(Path("m")));
}

}  // namespace
}  // namespace cohort
