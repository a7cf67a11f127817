// The commands as a user has them: the built program, run on good input and on bad. Bad input ends
// with one line on stderr and the right exit code: 1 failed, 2 usage.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <csignal>
#include <fstream>
#include <future>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <optional>
#include <string_view>
#include <thread>

#include "backend/colmap/model_io.h"
#include "frontend/core/error.h"
#include "frontend/core/statistics.h"
#include "frontend/storage/sqlite.h"
#include "frontend/storage/write_lock.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/sfm/input.h"
#include "pipelines/sfm/reconstruct.h"
#include "pipelines/sfm/track_sequence.h"
#include "tests/support/bal_errors.h"
#include "tests/support/child_process.h"
#include "tests/support/program.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using test::ProgramEnd;
using test::ProgramPath;
using test::RunCohort;
using test::RunShell;
using test::TempDir;
using testing::AllOf;
using testing::HasSubstr;
using testing::MatchesRegex;
using testing::Not;
using testing::StartsWith;
using std::string_view_literals::operator""sv;

constexpr const char* kCommands[] = {"track",
                                     "import",
                                     "export",
                                     "reconstruct",
                                     "refine",
                                     "evaluate",
                                     "synth",
                                     "degrade",
                                     "compare"};

// Frame i of a textured plane that moves 2 px to the left and 1 px up a frame.
cv::Mat MovingFrame(int i, int depth = CV_8U, cv::Size size = {160, 120}) {
  cv::Mat texture(400, 600, CV_32FC1);
  cv::RNG random(7);
  random.fill(texture, cv::RNG::UNIFORM, 0.0, 1.0);
  cv::GaussianBlur(texture, texture, {}, 2.0);
  cv::normalize(texture, texture, 0.0, 1.0, cv::NORM_MINMAX);
  cv::Mat frame;
  texture(cv::Rect({2 * i, i}, size)).convertTo(frame, depth, depth == CV_8U ? 255.0 : 65535.0);
  return frame;
}

std::string ImagePath(const fs::path& folder, int i) {
  return (folder / fmt::format("{:03}.png", i)).string();
}

fs::path WriteImages(const fs::path& folder, int frames, int depth = CV_8U) {
  fs::create_directories(folder);
  for (int i = 0; i < frames; ++i) cv::imwrite(ImagePath(folder, i), MovingFrame(i, depth));
  return folder;
}

fs::path WriteVideo(const fs::path& file, int frames) {
  cv::VideoWriter writer(
      file.string(), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 25.0, {160, 120});
  cv::Mat color;
  for (int i = 0; i < frames; ++i) {
    cv::cvtColor(MovingFrame(i), color, cv::COLOR_GRAY2BGR);
    writer.write(color);
  }
  return file;
}

void WriteText(const fs::path& file, const std::string& text) { std::ofstream(file) << text; }

nlohmann::json ReadJson(const fs::path& file) { return nlohmann::json::parse(ReadBytes(file)); }

// Exit code and one line, that names what it is about.
void ExpectFailure(const ProgramEnd& end,
                   int exit_code,
                   const testing::Matcher<const std::string&>& line) {
  EXPECT_EQ(end.exit_code, exit_code) << end.err;
  EXPECT_EQ(std::count(end.err.begin(), end.err.end(), '\n'), 1) << end.err;
  EXPECT_THAT(end.err, StartsWith("cohort: error: "));
  EXPECT_THAT(end.err, line);
}

// Of rendered clips.
constexpr const char* kSmall = " --width-px 160 --height-px 120 --focal-px 131";
constexpr const char* kMedium = " --width-px 320 --height-px 240 --focal-px 260";

class Commands : public testing::Test {
 protected:
  // What must end well.
  static void Run(const std::string& arguments) {
    const ProgramEnd end = RunCohort(arguments + " --quiet");
    ASSERT_EQ(end.exit_code, 0) << arguments << "\n" << end.err;
  }
  std::string Path(const std::string& name) const { return dir_ / name; }
  // Tracks a clip of eight frames.
  std::string Track(const std::string& clip, const std::string& more = "") const {
    return "track " + clip + " --tracker klt --features 30 --quiet --out " + Path("a.tracks") +
           " " + more;
  }

  TempDir dir_;
};

TEST_F(Commands, HelpNamesEveryOptionWithDefaultAndRange) {
  for (const char* command : kCommands) {
    const ProgramEnd end = RunCohort(std::string(command) + " --help");
    EXPECT_EQ(end.exit_code, 0) << command;
    EXPECT_EQ(end.err, "") << command;
    EXPECT_THAT(end.out, HasSubstr(std::string("Usage: cohort ") + command));
    EXPECT_THAT(end.out, AllOf(HasSubstr("--config"), HasSubstr("--quiet")));
  }
  EXPECT_THAT(RunCohort("track --help-all").out,
              AllOf(HasSubstr("--features, --detector.max-features"),
                    HasSubstr("default 1000)"),
                    HasSubstr("descent, klt, anchored-klt, rlof;"),
                    HasSubstr("--window"),
                    HasSubstr("--camera"),
                    HasSubstr("--mask")));
  const ProgramEnd all = RunCohort("--help");
  for (const char* command : kCommands) EXPECT_THAT(all.out, HasSubstr(command));
  EXPECT_THAT(RunCohort("--version").out, MatchesRegex("cohort [0-9.]+\n"));
}

// A full or closed stderr costs its messages, and nothing else.
TEST_F(Commands, AFullOrClosedStderrIsNoReasonToEnd) {
  const fs::path clip = WriteImages(Path("clip"), 8);
  // The last picture is damaged, so that there is a warning too.
  WriteText(ImagePath(clip, 8), "no picture");
  const std::string track = "track " + clip.string() + " --tracker klt --features 30 --out ";
  for (const char* to : {"2>/dev/full", "2>&-", "2> >(exit)"}) {
    // bash, for the last.
    const std::string run = fmt::format("bash -c '{} ", ProgramPath());
    const std::string out = Path("a.tracks");
    const ProgramEnd good = RunShell(fmt::format("{}{}{} {}'", run, track, out, to));
    EXPECT_EQ(good.exit_code, 0) << to;
    EXPECT_THAT(good.out, HasSubstr("observations")) << to;
    EXPECT_EQ(ReadTrackFile(out).frames.size(), 8U) << to;
    EXPECT_EQ(RunShell(run + "track missing --out b " + to + "'").exit_code, 1) << to;
    EXPECT_EQ(RunShell(run + "trak " + to + "'").exit_code, 2) << to;
    fs::remove(out);
  }
  // On a terminal there is a bar: `script` gives the program one.
  const ProgramEnd on_terminal = RunShell(std::string("script -qec '") + ProgramPath() + " " +
                                          track + Path("a.tracks") + "' /dev/full");
  EXPECT_EQ(ReadTrackFile(Path("a.tracks")).frames.size(), 8U) << on_terminal.out;
}

TEST_F(Commands, AFullOrClosedStdoutIsAFailureThatIsSaid) {
  const std::string track = Track(WriteImages(Path("clip"), 8).string());
  for (const char* to : {">/dev/full", ">&-"}) {
    ExpectFailure(RunCohort(track + to), 1, HasSubstr("cannot write to standard output"));
    EXPECT_EQ(ReadTrackFile(Path("a.tracks")).frames.size(), 8U) << to;
    ExpectFailure(
        RunCohort(std::string("--help") + to), 1, HasSubstr("cannot write to standard output"));
    // Longer than a buffer, so that it fails while it is printed.
    ExpectFailure(RunCohort(std::string("track --help-all") + to),
                  1,
                  HasSubstr("cannot write to standard output"));
  }
  // A reader who leaves, with work to be done.
  const ProgramEnd left =
      RunShell("bash -c '" + ProgramPath() + " " + track + " > >(exit); echo $?'");
  EXPECT_EQ(ReadTrackFile(Path("a.tracks")).frames.size(), 8U);
  EXPECT_THAT(left.out, testing::AnyOf("0\n", "1\n"));
}

TEST_F(Commands, AnErrorIsOneLineWhateverNamesAreInIt) {
  ExpectFailure(RunCohort("track \"$(printf 'a\\nb\\033[2Jc')\" --out " + Path("a.tracks")),
                1,
                HasSubstr("a b [2Jc"));
  const std::string folder = Path("clip");
  WriteImages(folder, 3);
  WriteText(folder + "/x\ny.png", "no picture");
  ExpectFailure(
      RunCohort(Track(folder)), 1, AllOf(HasSubstr("picture 'x y.png'"), HasSubstr("rename")));
}

// Where the standard library throws by itself, in words of its own.
TEST_F(Commands, APathThatTheSystemRefusesIsNamedWithTheReason) {
  const std::string clip = WriteImages(Path("clip"), 3);
  const std::string long_name = Path(std::string(256, 'a'));
  ExpectFailure(RunCohort("evaluate " + long_name + " --truth " + clip),
                1,
                HasSubstr("cannot use " + long_name + ": File name too long\n"));
  fs::create_directory(Path("loop"));
  fs::create_symlink("rgb.txt", Path("loop/rgb.txt"));
  ExpectFailure(
      RunCohort(Track(Path("loop"))),
      1,
      HasSubstr("cannot use " + Path("loop/rgb.txt") + ": Too many levels of symbolic links\n"));

  const std::string in_gone =
      "mkdir " + Path("gone") + " && cd " + Path("gone") + " && rmdir " + Path("gone") + " && ";
  ExpectFailure(RunShell(in_gone + ProgramPath() + " synth a --frames 1"),
                1,
                AllOf(HasSubstr("the current folder is gone"), HasSubstr("change to another")));
}

TEST_F(Commands, AFolderThatMayNotBeReadIsNamedWithTheReason) {
  const std::string clip = WriteImages(Path("clip"), 3);
  fs::permissions(dir_.path(), fs::perms(0755));
  fs::permissions(clip, fs::perms::none);
  const auto run = [](const std::string& arguments) {  // as a user who is not root
    return test::RunInChild([&] {
      test::DropRoot();
      return RunCohort(arguments).err;
    });
  };
  if (!run("--version").empty()) GTEST_SKIP() << "others may not run " << ProgramPath();
  EXPECT_EQ(run(Track(clip)),
            "cohort: error: cannot use " + clip + "/rgb.txt: Permission denied\n");
  fs::permissions(clip, fs::perms::owner_all);
}

TEST_F(Commands, APictureThatClaimsToBeHugeIsOneLine) {
  fs::create_directory(Path("clip"));
  for (const char* size : {"100000 100000", "40000 20000", "2147483647 2147483647"}) {
    WriteText(Path("clip/0.pgm"), std::string("P5 ") + size + " 255\nabc");
    ExpectFailure(RunCohort(Track(Path("clip"))), 1, HasSubstr("cannot decode"));
  }
}

// A .tracks file of somebody else, and a link in the way.
TEST_F(Commands, NamesOfFramesLeadOutOfNoFolder) {
  const std::string video = WriteVideo(Path("clip.avi"), 8).string();
  ASSERT_EQ(RunCohort(Track(video)).exit_code, 0);
  fs::create_directory(Path("out"));
  const std::string export_it =
      "export " + Path("a.tracks") + " --quiet --colmap-database " + Path("out/a.db");
  const std::string good = ReadBytes(Path("a.tracks"));
  for (const auto& [name, why] :
       std::map<std::string, std::string>{{"../../evil.png", "leads out of the folder"},
                                          {"../evil.png", "leads out of the folder"},
                                          {"/tmp/cohort-evil.png", "is an absolute path"},
                                          {"evil", "no longer has frame evil"}}) {
    WriteBytes(Path("a.tracks"), good);
    SqliteDatabase::Open(Path("a.tracks"), SqliteDatabase::Mode::kCreate)
        .Execute("UPDATE frames SET name = '" + name + "' WHERE \"index\" = 2");
    ExpectFailure(RunCohort(export_it), 1, AllOf(HasSubstr(name), HasSubstr(why)));
    EXPECT_FALSE(fs::exists(Path("out/a_images")));
    EXPECT_FALSE(fs::exists(fs::path(Path("out/a_images.partial")) / name));
  }
  EXPECT_FALSE(fs::exists("/tmp/cohort-evil.png"));

  WriteBytes(Path("a.tracks"), good);
  fs::create_directory(Path("elsewhere"));
  fs::create_directory_symlink(Path("elsewhere"), Path("out/a_images"));
  const ProgramEnd end = RunCohort(export_it);
  EXPECT_EQ(end.exit_code, 0) << end.err;
  EXPECT_TRUE(fs::is_empty(Path("elsewhere")));
  EXPECT_FALSE(fs::is_symlink(Path("out/a_images")));
  EXPECT_TRUE(fs::exists(Path("out/a_images/frame_000007.png")));
}

TEST_F(Commands, UnknownCommandFlagOrValueIsAUsageError) {
  ExpectFailure(RunCohort(""), 2, HasSubstr("cohort --help"));
  ExpectFailure(RunCohort("trak a.mp4"), 2, HasSubstr("unknown command 'trak'"));
  const std::string pictures = WriteImages(Path("pictures"), 1);
  ExpectFailure(
      RunCohort(pictures), 2, HasSubstr("'cohort sfm " + pictures + " --out scene' makes a scene"));
  ExpectFailure(
      RunCohort("track --out b -- -a.mp4"), 1, HasSubstr("no such file or folder: -a.mp4"));
  ExpectFailure(RunCohort("track --out b -- a.mp4 --features"), 2, HasSubstr("--features"));
  ExpectFailure(RunCohort("track a --featurs 3"), 2, HasSubstr("did you mean --features?"));
  ExpectFailure(
      RunCohort("track a --out b --features many"), 2, HasSubstr("is not a whole number"));
  ExpectFailure(RunCohort("track a --out b --tracker lk"), 2, HasSubstr("subspace, descent, klt"));
  ExpectFailure(RunCohort("track a --out"), 2, HasSubstr("--out"));
  ExpectFailure(RunCohort("track a --out= --quiet"), 2, HasSubstr("--out= has no value"));
  ExpectFailure(RunCohort("track a"), 2, HasSubstr("--out is missing"));
  ExpectFailure(RunCohort("export a.tracks"), 2, HasSubstr("nothing to export"));
  ExpectFailure(RunCohort("degrade a b --level dim"), 2, HasSubstr("clean, medium, hard"));
  ExpectFailure(RunCohort("compare a --out b --trackers orb"), 2, HasSubstr("tracker 'orb'"));
  ExpectFailure(RunCohort("compare a --out b --trackers sift --backends ceres"),
                2,
                HasSubstr("add colmap to --backends"));
  ExpectFailure(RunCohort("compare a --out b --shard 2/2"), 2, HasSubstr("--shard '2/2'"));
  ExpectFailure(
      RunCohort("compare a --out b --shard 0/2 --collect"), 2, HasSubstr("leave out --shard"));
  ExpectFailure(
      RunCohort("compare a --out b --seeds 1,2,01"), 2, HasSubstr("--seeds contains 1 twice"));
  const std::string clip = WriteImages(Path("clip"), 2);
  ExpectFailure(RunCohort(Track(clip, "--camera 1,2,3")), 2, HasSubstr("--camera '1,2,3'"));
  ExpectFailure(RunCohort(Track(clip, "--camera 0,1,1,1")), 2, HasSubstr("above 0"));
  ExpectFailure(RunCohort(Track(clip, "--frames 5:x")), 2, HasSubstr("5:x"));
}

// As job runners do; a child that inherits it is told of no child's end.
TEST_F(Commands, RunWhereTheCallerIgnoresTheEndOfChildren) {
  const std::string clip = WriteImages(Path("clip"), 6);
  const std::string ignoring = "timeout 100 env --ignore-signal=CHLD " + ProgramPath() + " ";
  const ProgramEnd end = test::RunShell(
      ignoring + "compare " + clip +
      " --camera 260,260,159.5,119.5 --levels clean --trackers klt21 --backends ceres --seeds 1 "
      "--features 30 --quiet --out " +
      Path("out"));
  EXPECT_EQ(end.exit_code, 0) << end.err;
  EXPECT_TRUE(fs::exists(Path("out/results.csv")));
}

TEST_F(Commands, OptionsThatChangeNothingAreSaid) {
  const std::string clip = WriteImages(Path("clip"), 8);
  const auto warned = [&](const std::string& arguments) {
    const ProgramEnd end = RunCohort(arguments + " --quiet");
    EXPECT_EQ(end.exit_code, 0) << end.err;
    return end.err;
  };
  EXPECT_EQ(warned(Track(clip, "--window 15 --klt.forward-backward-px 2")), "");
  EXPECT_THAT(warned(Track(clip, "--constraint weak --history 5 --rlof.forward-backward-px 2")),
              HasSubstr("tracker klt does not use rlof.forward_backward_px, subspace.constraint, "
                        "subspace.history_length: they have no effect"));
  const std::string track = "track " + clip + " --features 30 --out " + Path("b.tracks");
  EXPECT_THAT(warned(track + " --tracker rlof --window 15"),
              HasSubstr("tracker rlof does not use klt.window_px, subspace.template_px: they"));
  EXPECT_THAT(warned(track + " --tracker descent --uncentered --second-pass off"),
              HasSubstr("tracker descent does not use subspace.uncentered: it has no effect"));
  EXPECT_THAT(
      warned(track + " --tracker descent --measurement.max-rank 3 --measurement.window-px 19 "
                     "--second-pass off"),
      HasSubstr("tracker descent does not use measurement.window_px, measurement.max_rank: they"));
  EXPECT_THAT(warned(track + " --window 15 --history 5 --second-pass off"),
              HasSubstr("tracker subspace without a penalty does not use klt.window_px, "
                        "subspace.history_length, subspace.template_px: they have no effect"));
  EXPECT_EQ(warned(track + " --penalty nuclear-norm --history 5 --second-pass off"), "");

  Run("synth " + Path("scene") + kSmall + " --frames 10");
  Run("track " + Path("scene") + " --features 60 --second-pass off --out " + Path("s.tracks"));
  const std::string reconstruct =
      "reconstruct " + Path("s.tracks") + " --out " + Path("model") + " --backend ceres ";
  EXPECT_THAT(warned(reconstruct + "--seed 3"),
              HasSubstr("backend ceres does not use colmap.seed: it has no effect"));

  ExpectFailure(RunCohort("degrade " + clip + " " + Path("d") + " --codec hevc"),
                2,
                HasSubstr("--codec and --bitrate-kbit are for --recipe phone"));
  ExpectFailure(RunCohort("degrade " + clip + " " + Path("d") + " --light 0.5"),
                2,
                HasSubstr("--light is for the recipes sensor and phone"));
  ExpectFailure(
      RunCohort("show " + Path("s.tracks") + " --out " + Path("p.html") + " --width-px 64"),
      2,
      HasSubstr("--frames-per-second and --width-px are for a video"));
}

TEST_F(Commands, ConfigFilesSetWhatFlagsDoNot) {
  const std::string config = Path("c.json");
  const ProgramEnd dumped = RunCohort("track x --features 77 --window 15 --dump-config");
  ASSERT_EQ(dumped.exit_code, 0);
  WriteText(config, dumped.out);
  const ProgramEnd again = RunCohort("track --config " + config + " --features 78 --dump-config");
  const auto json = nlohmann::json::parse(again.out);
  EXPECT_EQ(json["input"], "x");
  EXPECT_EQ(json["detector"]["max_features"], 78);
  EXPECT_EQ(json["klt"]["window_px"], 15);

  WriteText(config, R"({"detector": {"max_feature": 5}})");
  ExpectFailure(RunCohort("track x --config " + config), 2, HasSubstr("detector.max_feature"));
  WriteText(config, "{");
  ExpectFailure(RunCohort("track x --config " + config), 1, HasSubstr("not valid JSON"));
  ExpectFailure(RunCohort("track x --config " + Path("d.json")), 1, HasSubstr("d.json"));
}

TEST_F(Commands, TracksAClipAndReportsItsFigures) {
  const std::string clip = WriteImages(Path("clip"), 8);
  const ProgramEnd end = RunCohort(Track(clip, "--json " + Path("f.json") + " --frames 1:8:2"));
  ASSERT_EQ(end.exit_code, 0) << end.err;
  EXPECT_EQ(end.err, "");
  EXPECT_THAT(end.out, HasSubstr("mean observed track length"));
  const TrackFile file = ReadTrackFile(Path("a.tracks"));
  ASSERT_EQ(file.frames.size(), 4u);
  EXPECT_EQ(file.frames[1].index, FrameIndex{3});
  EXPECT_EQ(file.frames[1].name, "003.png");
  EXPECT_EQ(file.image_root, clip);
  EXPECT_FALSE(file.camera);
  const Observation* first = file.tracks.Find(FeatureId{3}, FrameIndex{1});
  const Observation* second = file.tracks.Find(FeatureId{3}, FrameIndex{3});
  ASSERT_TRUE(first != nullptr && second != nullptr);
  EXPECT_NEAR(second->xy.x() - first->xy.x(), -4.0, 0.1);
  EXPECT_NEAR(second->xy.y() - first->xy.y(), -2.0, 0.1);

  const auto figures = ReadJson(Path("f.json"));
  EXPECT_EQ(figures["frames"], 4);
  EXPECT_EQ(figures["tracks"], file.tracks.features().size());
  EXPECT_EQ(figures["observations"], file.tracks.observations().size());
  EXPECT_EQ(figures["predicted"], file.tracks.CountPredicted());
  EXPECT_DOUBLE_EQ(figures["mean_track_length"], file.tracks.MeanObservedLength());
  for (const char* stage : {"decode", "detect", "track", "write"}) {
    EXPECT_GT(figures["ms_per_frame"][stage], 0.0) << stage;
  }
  EXPECT_EQ(figures["options"]["detector"]["max_features"], 30);
}

TEST_F(Commands, TheSameInputGivesTheSameBytesForAnyNumberOfThreads) {
  const std::string clip = WriteImages(Path("clip"), 6);
  std::vector<std::string> csv;
  for (const char* threads : {"1", "2", "3"}) {
    ASSERT_EQ(RunCohort("track " + clip + " --features 40 --quiet --out " + Path("a.tracks") +
                        " --threads " + threads)
                  .exit_code,
              0);
    ASSERT_EQ(RunCohort("export " + Path("a.tracks") + " --csv " + Path("a.csv")).exit_code, 0);
    csv.push_back(ReadBytes(Path("a.csv")));
  }
  EXPECT_GT(csv[0].size(), 1000u);
  EXPECT_EQ(csv[0], csv[1]);
  EXPECT_EQ(csv[0], csv[2]);
}

TEST_F(Commands, InputThatIsNotThereOrHoldsNoPicture) {
  ExpectFailure(RunCohort(Track(Path("none"))), 1, HasSubstr(Path("none")));
  fs::create_directory(Path("empty"));
  ExpectFailure(RunCohort(Track(Path("empty"))), 1, HasSubstr(Path("empty")));
  ExpectFailure(RunCohort(Track("'" + Path("empty") + "/*.png'")), 1, HasSubstr("*.png"));
  WriteText(Path("notes.txt"), "no video\n");
  ExpectFailure(RunCohort(Track(Path("notes.txt"))), 1, HasSubstr("notes.txt"));
  EXPECT_FALSE(fs::exists(Path("a.tracks")));
}

TEST_F(Commands, ATruncatedVideoKeepsWhatCanBeDecodedAndSaysSo) {
  const fs::path video = WriteVideo(Path("cut.avi"), 20);
  fs::resize_file(video, fs::file_size(video) * 6 / 10);
  const ProgramEnd end = RunCohort(Track(video));
  EXPECT_EQ(end.exit_code, 0);
  EXPECT_THAT(end.err, AllOf(StartsWith("cohort: warning: "), HasSubstr("of about 20")));
  EXPECT_EQ(std::count(end.err.begin(), end.err.end(), '\n'), 1) << end.err;
  const TrackFile file = ReadTrackFile(Path("a.tracks"));
  EXPECT_GT(file.frames.size(), 5u);
  EXPECT_LT(file.frames.size(), 20u);
}

TEST_F(Commands, FramesOfDifferentSizes) {
  const fs::path clip = WriteImages(Path("clip"), 4);
  cv::imwrite(ImagePath(clip, 2), MovingFrame(2, CV_8U, {150, 120}));
  ExpectFailure(RunCohort(Track(clip)), 1, AllOf(HasSubstr("002.png"), HasSubstr("150x120")));
}

TEST_F(Commands, OneAndTwoFrames) {
  for (const int frames : {1, 2}) {
    const std::string clip = WriteImages(Path(fmt::format("clip{}", frames)), frames);
    EXPECT_EQ(RunCohort(Track(clip)).exit_code, 0);
    EXPECT_EQ(ReadTrackFile(Path("a.tracks")).frames.size(), static_cast<std::size_t>(frames));
    ExpectFailure(
        RunCohort("reconstruct " + Path("a.tracks") + " --quiet --out " + Path("model")),
        1,
        AllOf(HasSubstr("the reconstruction failed"), HasSubstr(fmt::format("of {}", frames))));
    EXPECT_EQ(ReadJson(Path("model/summary.json"))["failed"], true);
  }
}

TEST_F(Commands, ColorAnd16BitImages) {
  const fs::path deep = WriteImages(Path("deep"), 3, CV_16U);
  ASSERT_EQ(RunCohort(Track(deep)).exit_code, 0);
  const TrackFile sixteen = ReadTrackFile(Path("a.tracks"));
  const fs::path plain = WriteImages(Path("plain"), 3);
  ASSERT_EQ(RunCohort(Track(plain)).exit_code, 0);
  const TrackFile eight = ReadTrackFile(Path("a.tracks"));
  EXPECT_NEAR(static_cast<double>(sixteen.tracks.observations().size()),
              static_cast<double>(eight.tracks.observations().size()),
              5.0);
  for (int i = 0; i < 3; ++i) {
    cv::Mat color;
    cv::cvtColor(MovingFrame(i), color, cv::COLOR_GRAY2BGR);
    cv::imwrite(ImagePath(plain, i), color);
  }
  ASSERT_EQ(RunCohort(Track(plain)).exit_code, 0);
  EXPECT_EQ(ReadTrackFile(Path("a.tracks")).tracks.observations().size(),
            eight.tracks.observations().size());
}

TEST_F(Commands, ImportsWhatItExports) {
  const std::string clip = WriteImages(Path("clip"), 5);
  ASSERT_EQ(RunCohort(Track(clip)).exit_code, 0);
  ASSERT_EQ(RunCohort("export " + Path("a.tracks") + " --csv " + Path("a.csv")).exit_code, 0);
  const ProgramEnd end = RunCohort("import " + Path("a.csv") + " --images " + clip +
                                   " --camera 150,150,79.5,59.5 --quiet --out " + Path("b.tracks"));
  ASSERT_EQ(end.exit_code, 0) << end.err;
  ASSERT_EQ(RunCohort("export " + Path("b.tracks") + " --csv " + Path("b.csv")).exit_code, 0);
  EXPECT_EQ(ReadBytes(Path("a.csv")), ReadBytes(Path("b.csv")));
  const TrackFile file = ReadTrackFile(Path("b.tracks"));
  EXPECT_EQ(file.frames.size(), 5u);
  ASSERT_TRUE(file.camera);
  EXPECT_EQ(file.camera->fx, 150.0);
  EXPECT_EQ(file.camera->width_px, 160);
}

TEST_F(Commands, ImportsWhateverFormItExports) {
  const std::string clip = WriteImages(Path("clip"), 5);
  ASSERT_EQ(RunCohort(Track(clip, "--camera 150,150,79.5,59.5")).exit_code, 0);
  ASSERT_EQ(RunCohort("export " + Path("a.tracks") + " --npz " + Path("a.npz") + " --opensfm " +
                      Path("o.csv") + " --colmap-database " + Path("a.db"))
                .exit_code,
            0);
  const TrackFile file = ReadTrackFile(Path("a.tracks"));
  const auto import = [&](const char* name) {
    const ProgramEnd end = RunCohort("import " + Path(name) + " --images " + clip +
                                     " --quiet --out " + Path("b.tracks"));
    EXPECT_EQ(end.exit_code, 0) << end.err;
    return ReadTrackFile(Path("b.tracks"));
  };
  const TrackFile npz = import("a.npz");
  ASSERT_EQ(npz.tracks.observations().size(), file.tracks.observations().size());
  for (std::size_t i = 0; i < npz.tracks.observations().size(); ++i) {
    EXPECT_EQ(npz.tracks.observations()[i].xy, file.tracks.observations()[i].xy);
    EXPECT_EQ(npz.tracks.observations()[i].state, file.tracks.observations()[i].state);
  }
  EXPECT_FALSE(npz.camera);
  EXPECT_EQ(import("o.csv").tracks.observations().size(), file.tracks.CountObserved());
  const TrackFile database = import("a.db");
  EXPECT_GT(database.tracks.features().size(), file.tracks.features().size() / 2);
  ASSERT_TRUE(database.KnowsCamera());
  EXPECT_EQ(database.camera->fx, 150.0);
  EXPECT_EQ(database.meta.imported_from, Path("a.db"));
}

TEST_F(Commands, ImportsTheTracksOfAModelFolder) {
  Run("synth " + Path("clip") + kMedium + " --frames 16");
  Run("track " + Path("clip") + " --features 150 --out " + Path("a.tracks"));
  Run("reconstruct " + Path("a.tracks") + " --out " + Path("m"));
  Run("import " + Path("m") + " --images " + Path("clip") + " --out " + Path("b.tracks"));
  const TrackFile file = ReadTrackFile(Path("a.tracks"));
  const TrackFile model = ReadTrackFile(Path("b.tracks"));
  EXPECT_EQ(model.tracks.observations().size(), ReadJson(dir_ / "m/summary.json")["observations"]);
  for (const Observation& o : model.tracks.observations()) {
    const Observation* before = file.tracks.Find(o.feature, o.frame);
    ASSERT_NE(before, nullptr);
    EXPECT_LT((o.xy - before->xy).norm(), 1e-9);
  }
  EXPECT_NEAR(model.camera->fx, 260.0, 1e-9);
  EXPECT_NEAR(model.camera->cx, 159.5, 1e-9);
}

TEST_F(Commands, ImportsAsPredictedWhatLiesOutsideThePicture) {
  const std::string clip = WriteImages(Path("clip"), 3);
  const std::string import =
      "import " + Path("a.csv") + " --images " + clip + " --out " + Path("b.tracks");
  WriteText(Path("a.csv"), "track_id,frame,x,y\n0,0,-500,1e6\n0,1,5,5\n0,2,159.5,119.5\n");
  const ProgramEnd end = RunCohort(import);
  EXPECT_EQ(end.exit_code, 0);
  EXPECT_THAT(end.err, HasSubstr("1 observed positions lie outside the picture"));
  const TrackSet tracks = ReadTrackFile(Path("b.tracks")).tracks;
  EXPECT_EQ(tracks.CountObserved(), 2u);
  EXPECT_EQ(tracks.CountPredicted(), 1u);
  WriteText(Path("a.csv"), "track_id,frame,x,y\n0,0,-500,1e6\n0,1,5,5\n0,2,160,5\n");
  ExpectFailure(RunCohort(import + " --quiet"), 1, HasSubstr("2 of 3 observed positions"));
}

// A model, or a truth, of another clip gives figures, too: of nothing.
TEST_F(Commands, WhatIsOfAnotherClipIsRefused) {
  Run("synth " + Path("a") + kMedium + " --frames 12");
  Run("synth " + Path("longer") + kMedium + " --frames 16");
  Run("synth " + Path("smaller") + " --width-px 240 --height-px 180 --focal-px 195 --frames 12");
  for (const std::string clip : {"a", "longer", "smaller"}) {
    Run("track " + Path(clip) + " --features 150 --out " + Path(clip + ".tracks"));
    Run("reconstruct " + Path(clip + ".tracks") + " --out " + Path(clip + ".model"));
  }
  const std::string tracks = Path("a.tracks");
  for (const std::string other : {"longer", "smaller"}) {
    const auto onto = [&](const char* command, const char* outputs) {
      return RunCohort(fmt::format("{} {} --model {} {}",
                                   command,
                                   tracks,
                                   Path(other + ".model"),
                                   fmt::format(fmt::runtime(outputs), Path("x"))));
    };
    const auto give = HasSubstr("give the model that was made from " + tracks);
    ExpectFailure(onto("refine", "--out {}"), 1, give);
    ExpectFailure(onto("show", "--out {}.html"), 1, give);
    ExpectFailure(onto("export", "--global-shutter --csv {}"), 1, give);
  }
  const auto evaluate = [&](const std::string& what, const std::string& clip) {
    return RunCohort("evaluate " + Path(what) + " --truth " + Path(clip));
  };
  ExpectFailure(evaluate("a.tracks", "smaller"),
                1,
                HasSubstr("give the clip that the tracks were made from"));
  ExpectFailure(
      evaluate("longer.tracks", "a"), 1, HasSubstr("give the clip that the tracks were made from"));
  ExpectFailure(
      evaluate("longer.model", "a"), 1, HasSubstr("give the clip that the model was made from"));
  EXPECT_THAT(evaluate("smaller.model", "a").err, HasSubstr("check that it belongs to this clip"));
  EXPECT_EQ(evaluate("a.model", "a").err, "");
}

TEST_F(Commands, TellsACalibrationOfAnotherSize) {
  const std::string clip = WriteImages(Path("clip"), 3);
  const std::string track =
      "track " + clip + " --features 30 --second-pass off --quiet --out " + Path("a.tracks");
  EXPECT_THAT(RunCohort(track + " --camera 1500,1500,960,540").err,
              HasSubstr("for pictures of this size"));
  EXPECT_EQ(RunCohort(track + " --camera 150,150,79.5,59.5").err, "");
}

// Four pictures by a lens of 26 mm of 35 mm film, as EXIF says: 120.2 px.
std::string WriteImagesWithExif(const std::string& folder) {
  fs::create_directory(folder);
  constexpr std::string_view kExif =
      "\xFF\xE1\0\x34"
      "Exif\0\0MM\0*\0\0\0\x08"
      "\0\x01\x87\x69\0\x04\0\0\0\x01\0\0\0\x1A\0\0\0\0"
      "\0\x01\xA4\x05\0\x03\0\0\0\x01\0\x1A\0\0\0\0\0\0"sv;
  for (int i = 0; i < 4; ++i) {
    std::vector<std::uint8_t> jpeg;
    cv::imencode(".jpg", MovingFrame(i), jpeg);
    std::string bytes(jpeg.begin(), jpeg.end());
    bytes.insert(2, kExif);
    WriteText(fs::path(folder) / fmt::format("{}.jpg", i), bytes);
  }
  return folder;
}

TEST_F(Commands, APriorOfTheFocalLengthIsAGuessWithItsUncertainty) {
  const std::string clip = WriteImages(Path("clip"), 3);
  const auto camera_of = [&](const std::string& prior) {
    const ProgramEnd end = RunCohort(Track(clip, "--second-pass off --camera-prior " + prior));
    EXPECT_EQ(end.exit_code, 0) << end.err;
    return ReadTrackFile(Path("a.tracks")).camera.value();
  };
  for (const char* prior : {"150+-30", "150\u00b130"}) {
    const Camera camera = camera_of(prior);
    EXPECT_FALSE(camera.known);
    EXPECT_EQ(camera.fx, 150.0);
    EXPECT_EQ(camera.fy, 150.0);
    EXPECT_EQ(camera.cx, 79.5);
    EXPECT_DOUBLE_EQ(camera.guess_log_sigma, 0.2);
  }
  EXPECT_DOUBLE_EQ(camera_of("150").guess_log_sigma, 0.1) << "10 % where nothing is said";
  for (const char* wrong : {"wide",
                            "-150",
                            "0",
                            "nan",
                            "inf",
                            "1e13",
                            "150+-0",
                            "150+--3",
                            "-150+--3",
                            "150+-",
                            "+-3",
                            "150+-nan",
                            "150+-3px",
                            "150,150"}) {
    ExpectFailure(RunCohort(Track(clip, fmt::format("--camera-prior={}", wrong))),
                  2,
                  HasSubstr(fmt::format("--camera-prior '{}'", wrong)));
  }
  const std::string both = "--camera-prior 150 --camera 150,150,79.5,59.5";
  ExpectFailure(RunCohort(Track(clip, both)), 2, HasSubstr("give one of them"));
  ExpectFailure(RunCohort("compare " + clip + " --camera-prior wide --out " + Path("compared")),
                2,
                HasSubstr("--camera-prior 'wide'"));
}

TEST_F(Commands, WhatExifSaysOfTheCameraIsAGuess) {
  const std::string clip = WriteImagesWithExif(Path("clip"));
  const std::string options = " --second-pass off --features 30 --out " + Path("a.tracks");
  ProgramEnd end = RunCohort("track " + clip + options);
  ASSERT_EQ(end.exit_code, 0) << end.err;
  EXPECT_THAT(end.err,
              HasSubstr("the camera is not known; the reconstruction starts from EXIF "
                        "FocalLengthIn35mmFilm 26 mm, which gives a focal length of about 120 px"));
  TrackFile file = ReadTrackFile(Path("a.tracks"));
  ASSERT_TRUE(file.camera);
  EXPECT_FALSE(file.camera->known);
  EXPECT_NEAR(file.camera->fx, 120.2, 0.05);
  EXPECT_EQ(file.camera->guess_log_sigma, 0.1);
  EXPECT_EQ(file.meta.focal_source, "EXIF FocalLengthIn35mmFilm 26 mm");

  // Tracks of others, and what the user thinks, which counts more.
  ASSERT_EQ(RunCohort("export " + Path("a.tracks") + " --csv " + Path("a.csv")).exit_code, 0);
  const std::string import = "import " + Path("a.csv") + " --images " + clip + " --out ";
  end = RunCohort(import + Path("b.tracks"));
  EXPECT_THAT(end.err, HasSubstr("gives a focal length of about 120 px"));
  EXPECT_NEAR(ReadTrackFile(Path("b.tracks")).camera->fx, 120.2, 0.05);
  end = RunCohort(import + Path("b.tracks") + " --camera-prior 150");
  EXPECT_THAT(end.err, Not(HasSubstr("EXIF")));
  file = ReadTrackFile(Path("b.tracks"));
  EXPECT_EQ(file.camera->fx, 150.0);
  EXPECT_EQ(file.meta.focal_source, "");
}

TEST_F(Commands, APriorTakesThePlaceOfACalibration) {
  Run("synth " + Path("clip") + kSmall + " --frames 3");
  const std::string track =
      "track " + Path("clip") + " --second-pass off --features 30 --out " + Path("a.tracks");
  ASSERT_EQ(RunCohort(track).exit_code, 0);
  EXPECT_TRUE(ReadTrackFile(Path("a.tracks")).KnowsCamera());
  ASSERT_EQ(RunCohort(track + " --camera-prior 150+-15").exit_code, 0);
  const Camera camera = ReadTrackFile(Path("a.tracks")).camera.value();
  EXPECT_FALSE(camera.known);
  EXPECT_EQ(camera.fx, 150.0);
  // What is not known is no calibration of a copy either.
  Run("degrade " + Path("clip") + " " + Path("dark") + " --camera-prior 150");
  EXPECT_FALSE(fs::exists(Path("dark/calibration.txt")));
}

TEST_F(Commands, ImportSaysInOneLineWhatATrackFileIsNot) {
  const std::string clip = WriteImages(Path("clip"), 3);
  const auto import = [&](const std::string& arguments) {
    return RunCohort("import " + arguments + " --images " + clip + " --quiet --out " +
                     Path("b.tracks"));
  };
  ASSERT_EQ(RunCohort(Track(clip)).exit_code, 0);
  ASSERT_EQ(RunCohort("export " + Path("a.tracks") + " --npz " + Path("a.npz") +
                      " --colmap-database " + Path("a.db"))
                .exit_code,
            0);
  ExpectFailure(import(Path("missing.npz")), 1, HasSubstr("missing.npz"));
  ExpectFailure(import(clip), 1, HasSubstr("cameras"));
  ExpectFailure(import(Path("a.tracks")), 1, HasSubstr("not a COLMAP database"));
  ExpectFailure(import(Path("a.npz") + " --from colmap"), 1, HasSubstr("a.npz"));
  ExpectFailure(import(Path("a.npz") + " --from pickle"), 2, HasSubstr("pickle"));
  ExpectFailure(
      import(Path("a.npz") + " --frames 0:2"), 1, HasSubstr("frame 2 is not among the 2"));
  ExpectFailure(import(Path("a.npz") + " --npz.size 5"), 2, HasSubstr("--npz.size"));
  const std::string whole = ReadBytes(Path("a.npz"));
  WriteText(Path("cut.npz"), whole.substr(0, whole.size() / 2));
  ExpectFailure(import(Path("cut.npz")), 1, HasSubstr("cut.npz"));
  // The same database with pictures of another size.
  const std::string large = Path("large");
  fs::create_directory(large);
  for (int i = 0; i < 3; ++i) {
    cv::imwrite(ImagePath(large, i), MovingFrame(i, CV_8U, {200, 160}));
  }
  ExpectFailure(RunCohort("import " + Path("a.db") + " --images " + large + " --quiet --out " +
                          Path("b.tracks")),
                1,
                HasSubstr("160 x 120"));
  EXPECT_FALSE(fs::exists(Path("b.tracks")));
}

TEST_F(Commands, TakesACameraOfAnyModel) {
  const std::string clip = WriteImages(Path("clip"), 2);
  ASSERT_EQ(RunCohort(Track(clip, "--camera 150,151,79.5,59.5,0.1,0.2,0.3,0.4,0.5")).exit_code, 0);
  EXPECT_EQ(ReadTrackFile(Path("a.tracks")).camera->k3, 0.5);
  ASSERT_EQ(RunCohort(Track(clip, "--camera 150,151,79.5,59.5,fisheye,0.1,0.2,0.3,0.4")).exit_code,
            0);
  const Camera fisheye = ReadTrackFile(Path("a.tracks")).camera.value();
  EXPECT_EQ(fisheye.model, CameraModel::kFisheye);
  EXPECT_EQ(fisheye.k4, 0.4);
  EXPECT_EQ(fisheye.height_px, 120);
}

TEST_F(Commands, ImportNamesTheLineThatItCannotUse) {
  const std::string clip = WriteImages(Path("clip"), 3);
  const auto import = [&](const std::string& rows) {
    WriteText(Path("a.csv"), "track_id,frame,x,y\n" + rows);
    return RunCohort("import " + Path("a.csv") + " --images " + clip + " --quiet --out " +
                     Path("b.tracks"));
  };
  ExpectFailure(import("0,0,1,2\n0,1,nan,2\n"), 1, AllOf(HasSubstr("a.csv"), HasSubstr("3")));
  ExpectFailure(import("4,1,1,2\n4,1,1,2\n"), 1, AllOf(HasSubstr("a.csv"), HasSubstr("4")));
  ExpectFailure(import("0,0,1\n"), 1, HasSubstr("a.csv"));
  ExpectFailure(import("0,7,1,2\n"), 1, HasSubstr("frame 7 is not among the 3 frames"));
  ExpectFailure(import("0,1,1,2\n0,3,1,2\n"), 1, HasSubstr("frames count from 0, not from 1"));
  std::string shares;
  for (int i = 0; i < 40; ++i) shares += fmt::format("{},0,{},{}\n", i, i / 40.0, 1.0 - i / 40.0);
  ExpectFailure(import(shares),
                1,
                AllOf(HasSubstr("between 0 and 1, not in pixels"), HasSubstr("multiply x")));
  WriteText(Path("a.csv"), "a,b\n1,2\n");
  ExpectFailure(
      RunCohort("import " + Path("a.csv") + " --images " + clip + " --out " + Path("b.tracks")),
      1,
      HasSubstr("a.csv"));
  EXPECT_FALSE(fs::exists(Path("b.tracks")));
}

TEST_F(Commands, AFolderThatCannotBeWritten) {
  const std::string clip = WriteImages(Path("clip"), 3);
  ExpectFailure(RunCohort("track " + clip + " --quiet --out " + Path("no/a.tracks")),
                1,
                HasSubstr("no/a.tracks"));
  // Not even root can write here.
  ExpectFailure(
      RunCohort("track " + clip + " --quiet --out /proc/a.tracks"), 1, HasSubstr("/proc/a.tracks"));
  ASSERT_EQ(RunCohort(Track(clip)).exit_code, 0);
  ExpectFailure(
      RunCohort("export " + Path("a.tracks") + " --csv /proc/a.csv"), 1, HasSubstr("/proc/a.csv"));
  ExpectFailure(RunCohort("reconstruct " + Path("a.tracks") + " --quiet --out /proc/m"),
                1,
                HasSubstr("/proc/m"));
  ExpectFailure(RunCohort("synth /proc/clip --frames 1"), 1, HasSubstr("/proc/clip"));
  ExpectFailure(RunCohort("degrade " + clip + " /proc/clip"), 1, HasSubstr("/proc/clip"));
  ExpectFailure(RunCohort("compare " + clip + " --out /proc/x"), 1, HasSubstr("/proc/x"));
  ExpectFailure(RunCohort("compare " + clip + " --quiet --mask none.png --out " + Path("grid")),
                1,
                HasSubstr("cannot read the mask none.png"));
}

// A bound on the size of files stands in for a disk that is full.
TEST_F(Commands, AFullDiskKeepsTheOldFile) {
  const std::string clip = WriteImages(Path("clip"), 8);
  ASSERT_EQ(RunCohort(Track(clip)).exit_code, 0);
  const std::string full = std::string("trap '' XFSZ; ulimit -f 4; ") + ProgramPath() + " ";

  WriteText(Path("a.csv"), "the old file");
  ExpectFailure(RunShell(full + "export " + Path("a.tracks") + " --csv " + Path("a.csv")),
                1,
                HasSubstr("a.csv"));
  EXPECT_EQ(ReadBytes(Path("a.csv")), "the old file");

  const std::string tracks = ReadBytes(Path("a.tracks"));
  ExpectFailure(RunShell(full + Track(clip)), 1, HasSubstr("a.tracks"));
  EXPECT_EQ(ReadBytes(Path("a.tracks")), tracks);

  ExpectFailure(RunShell(full + "synth " + Path("new") + " --frames 1"), 1, HasSubstr("new"));
  EXPECT_FALSE(fs::exists(Path("new")));
}

TEST_F(Commands, WithoutColmapSaysHowToGetIt) {
  const std::string clip = WriteImages(Path("clip"), 3);
  ASSERT_EQ(RunCohort(Track(clip)).exit_code, 0);
  const std::string reconstruct =
      "reconstruct " + Path("a.tracks") + " --backend colmap --quiet --out " + Path("m");
  ExpectFailure(RunCohort(reconstruct + " --colmap-program " + Path("colmap")),
                1,
                AllOf(HasSubstr(Path("colmap")), HasSubstr("apt")));
  ExpectFailure(
      RunShell("PATH=/nowhere " + ProgramPath() + " " + reconstruct), 1, HasSubstr("apt"));
  EXPECT_FALSE(fs::exists(Path("m")));
}

TEST_F(Commands, AFileThatIsNoTracksFile) {
  WriteText(Path("x.tracks"), "nothing");
  for (const std::string& command : {"export " + Path("x.tracks") + " --csv " + Path("a.csv"),
                                     "reconstruct " + Path("x.tracks") + " --out " + Path("m")}) {
    ExpectFailure(RunCohort(command), 1, HasSubstr("x.tracks"));
  }
  ExpectFailure(RunCohort("export " + Path("none.tracks") + " --csv " + Path("a.csv")),
                1,
                HasSubstr("none.tracks"));
}

TEST_F(Commands, ExportOfABlackClipSaysThatItIsEmpty) {
  const std::string clip = Path("clip");
  fs::create_directory(clip);
  for (int i = 0; i < 3; ++i) cv::imwrite(ImagePath(clip, i), cv::Mat::zeros(120, 160, CV_8U));
  Run(Track(clip));
  const ProgramEnd end = RunCohort("export " + Path("a.tracks") + " --csv " + Path("a.csv"));
  EXPECT_EQ(end.exit_code, 0);
  EXPECT_THAT(end.err, HasSubstr("a.tracks has no observations"));
}

TEST_F(Commands, ExportOfAVideoWritesTheFramesThatTheDatabaseNames) {
  const std::string video = WriteVideo(Path("clip.avi"), 4);
  ASSERT_EQ(RunCohort(Track(video, "--frames 0:4:2")).exit_code, 0);
  const ProgramEnd end = RunCohort("export " + Path("a.tracks") + " --quiet --colmap-database " +
                                   Path("c.db") + " --opensfm " + Path("o.csv"));
  ASSERT_EQ(end.exit_code, 0) << end.err;
  EXPECT_THAT(end.out, HasSubstr("--image_path " + Path("c_images")));
  for (const FrameInfo& frame : ReadTrackFile(Path("a.tracks")).frames) {
    EXPECT_TRUE(fs::exists(Path("c_images") + "/" + frame.name)) << frame.name;
  }
  EXPECT_TRUE(fs::exists(Path("o.csv")));
}

TEST_F(Commands, RendersDegradesAndEvaluates) {
  Run("synth " + Path("clip") + kSmall + " --frames 6");
  ASSERT_EQ(RunCohort("degrade " + Path("clip") + " " + Path("dark") + " --level 0.5").exit_code,
            0);
  EXPECT_LT(cv::mean(cv::imread(Path("dark/rgb/000003.png"), cv::IMREAD_GRAYSCALE))[0],
            0.8 * cv::mean(cv::imread(Path("clip/rgb/000003.png"), cv::IMREAD_GRAYSCALE))[0]);
  ASSERT_EQ(RunCohort(Track(Path("dark"))).exit_code, 0);
  ASSERT_TRUE(ReadTrackFile(Path("a.tracks")).camera);
  const ProgramEnd end = RunCohort("evaluate " + Path("a.tracks") + " --truth " + Path("dark") +
                                   " --json " + Path("e.json"));
  ASSERT_EQ(end.exit_code, 0) << end.err;
  EXPECT_LT(ReadJson(Path("e.json"))["observed"]["median_px"], 1.0);
  EXPECT_GT(ReadJson(Path("e.json"))["observed"]["count"], 50);
  const std::size_t without_truth = ReadJson(Path("e.json"))["tracks_without_truth"];
  ASSERT_EQ(RunCohort("evaluate " + Path("a.tracks") + " --truth " + Path("dark") +
                      " --edge-px 10 --json " + Path("off_edges.json"))
                .exit_code,
            0);
  EXPECT_GT(ReadJson(Path("off_edges.json"))["tracks_without_truth"], without_truth);

  const std::string images = WriteImages(Path("images"), 2);
  ExpectFailure(RunCohort("evaluate " + Path("a.tracks") + " --truth " + images),
                1,
                HasSubstr("has no true tracks"));
}

TEST_F(Commands, SaysThatNothingOfImportedTracksIsObserved) {
  const std::string images = WriteImages(Path("images"), 2);
  WriteText(Path("none.csv"), "frame,track_id,x,y,observed\n0,0,50,50,0\n1,0,51,50,0\n");
  const ProgramEnd end = RunCohort("import " + Path("none.csv") + " --images " + images +
                                   " --quiet --out " + Path("none.tracks"));
  EXPECT_EQ(end.exit_code, 0) << end.err;
  EXPECT_THAT(end.err, HasSubstr("none.csv: none of its 2 positions is observed"));
}

TEST_F(Commands, ImportRefusesOptionsOfOtherForms) {
  const std::string images = WriteImages(Path("images"), 2);
  WriteText(Path("a.csv"), "frame,track_id,x,y\n0,0,50,50\n1,0,51,50\n");
  ExpectFailure(RunCohort("import " + Path("a.csv") + " --npz.origin pixel-corner --images " +
                          images + " --quiet --out " + Path("a.tracks")),
                2,
                HasSubstr("--npz.* is for NumPy files"));
}

// Of some of the clip's pictures, and of images that begin with another number.
TEST_F(Commands, SaysThatWhatIsEvaluatedHasOtherNamesThanTheTruth) {
  Run("synth " + Path("clip") + kMedium + " --frames 16");
  fs::create_directories(dir_ / "some");
  for (const char* name :
       {"000004.png", "000006.png", "000008.png", "000010.png", "000012.png", "000014.png"}) {
    fs::copy(dir_ / "clip/rgb" / name, dir_ / "some");
  }
  Run("track " + Path("some") + " --tracker klt --features 100 --out " + Path("a.tracks"));
  Run("reconstruct " + Path("a.tracks") + " --out " + Path("model"));
  for (const char* subject : {"a.tracks", "model"}) {
    EXPECT_THAT(RunCohort("evaluate " + Path(subject) + " --quiet --truth " + Path("clip")).err,
                HasSubstr("frame 0 of " + Path(subject) +
                          " is called 000004.png, which is the name of frame 4 of"));
  }
  fs::remove(dir_ / "model/summary.json");  // another program's: images go by their names
  fs::create_directories(dir_ / "fewer/rgb");
  for (const char* name : {"groundtruth.txt", "calibration.txt"})
    fs::copy(dir_ / "clip" / name, dir_ / "fewer");
  WriteText(dir_ / "fewer/rgb.txt",
            "0 rgb/000004.png\n0.066666667 rgb/000006.png\n0.133333333 rgb/000008.png\n");
  fs::copy(dir_ / "clip/rgb", dir_ / "fewer/rgb", fs::copy_options::recursive);
  EXPECT_THAT(RunCohort("evaluate " + Path("model") + " --quiet --truth " + Path("fewer")).err,
              HasSubstr("3 of its images are not frames of fewer"));
}

TEST_F(Commands, SaysThatTracksAreEvaluatedByOtherFrames) {
  Run("synth " + Path("clip") + kSmall + " --frames 9");
  Run("degrade " + Path("clip") + " " + Path("thin") + " --level clean --frames ::3");
  ASSERT_EQ(RunCohort(Track(Path("thin"))).exit_code, 0);
  const std::string evaluate = "evaluate " + Path("a.tracks") + " --quiet --truth ";
  EXPECT_EQ(RunCohort(evaluate + Path("thin")).err, "");
  EXPECT_THAT(RunCohort(evaluate + Path("clip")).err,
              HasSubstr("frames 0 and 1 are 100 ms apart in " + Path("a.tracks") +
                        ", but 33 ms in clip: check that they are the same frames"));
}

TEST_F(Commands, DegradesWithTheCameraThatIsGiven) {
  Run("synth " + Path("clip") + kSmall + " --frames 3");
  Run("degrade " + Path("clip") + " " + Path("dark") + " --camera 150,151,80,60,0.1");
  EXPECT_EQ(ReadBytes(Path("dark/calibration.txt")), "150 151 80 60 0.1 0 0 0\n");
  Run("degrade " + Path("clip/rgb") + " " + Path("unknown"));
  EXPECT_FALSE(fs::exists(Path("unknown/calibration.txt")));
  ExpectFailure(RunCohort("degrade " + Path("clip") + " " + Path("never") + " --camera 150"),
                2,
                HasSubstr("--camera '150'"));
  EXPECT_FALSE(fs::exists(Path("never")));
}

// `export --global-shutter --bal`: a problem whose positions fit its cameras, which have one pose a
// frame.
TEST_F(Commands, ExportsAProblemAsAGlobalShutterHasIt) {
  Run("synth " + Path("clip") + kMedium + " --frames 20 --readout 0.7");
  Run("track " + Path("clip") + " --tracker klt --features 150 --out " + Path("a.tracks"));
  Run("reconstruct " + Path("a.tracks") + " --out " + Path("m"));
  ASSERT_GT(ReadJson(Path("m/summary.json"))["readout"], 0.5);
  const std::string bal = "export " + Path("a.tracks") + " --model " + Path("m") + " --bal ";
  EXPECT_THAT(RunCohort(bal + Path("seen.txt")).err,
              AllOf(HasSubstr("it has a rolling shutter"), HasSubstr("--global-shutter")));
  EXPECT_THAT(RunCohort(bal + Path("global.txt") + " --global-shutter").err,
              Not(HasSubstr("shutter")));
  EXPECT_LT(Median(test::BalErrors(Path("global.txt"))),
            0.5 * Median(test::BalErrors(Path("seen.txt"))));
}

TEST_F(Commands, ReconstructsWithCeresAndJudgesTheModel) {
  Run("synth " + Path("clip") + kMedium + " --frames 16");
  ASSERT_EQ(RunCohort("track " + Path("clip") + " --tracker klt --quiet --features 150 --out " +
                      Path("a.tracks"))
                .exit_code,
            0);
  const ProgramEnd end =
      RunCohort("reconstruct " + Path("a.tracks") + " --backend ceres --quiet --out " + Path("m") +
                " --json " + Path("r.json"));
  ASSERT_EQ(end.exit_code, 0) << end.err;
  for (const char* key : {"registered",
                          "frames",
                          "points",
                          "observations",
                          "mean_track_length",
                          "mean_reprojection_px",
                          "seconds",
                          "termination"}) {
    EXPECT_TRUE(ReadJson(Path("r.json")).contains(key)) << key;
  }
  for (const char* file : {"cameras.txt",
                           "images.txt",
                           "points3D.txt",
                           "cameras.bin",
                           "images.bin",
                           "points3D.bin",
                           "trajectory.tum",
                           "points.ply",
                           "summary.json"}) {
    EXPECT_TRUE(fs::exists(dir_ / "m" / file)) << file;
  }
  ASSERT_EQ(
      RunCohort("evaluate " + Path("m") + " --truth " + Path("clip") + " --json " + Path("e.json"))
          .exit_code,
      0);
  const auto figures = ReadJson(Path("e.json"));
  EXPECT_EQ(figures["registered"], 16);
  EXPECT_EQ(figures["frames"], 16);
  EXPECT_LT(figures["ate_m"], 0.02);

  const auto summary = ReadJson(dir_ / "m" / "summary.json");
  const std::string lost = ReadBytes(dir_ / "m" / "tracks_without_point.csv");
  EXPECT_THAT(lost, StartsWith("track_id,observations\n"));
  EXPECT_EQ(std::count(lost.begin(), lost.end(), '\n') - 1, summary["tracks_without_point"]);
  EXPECT_EQ(summary["camera"]["model"], "pinhole");
  EXPECT_EQ(summary["camera"]["k6"], 0.0);

  const std::string bal = "export " + Path("a.tracks") + " --bal " + Path("problem.txt");
  ASSERT_EQ(RunCohort(bal + " --model " + Path("m")).exit_code, 0);
  EXPECT_THAT(ReadBytes(Path("problem.txt")),
              StartsWith(fmt::format(
                  "16 {} {}\n", summary["points"].get<int>(), summary["observations"].get<int>())));
  ExpectFailure(RunCohort(bal), 2, HasSubstr("--model"));

  // A killed run leaves the old model, and nothing that is in the way of the next.
  const std::string before = ReadBytes(dir_ / "m" / "images.bin");
  const std::string again = "reconstruct " + Path("a.tracks") + " --quiet --out " + Path("m");
  const ProgramEnd killed = RunShell(fmt::format(
      "{} {} & pid=$!; while [ ! -d {}.partial ]; do sleep 0.005; done; kill -9 $pid; wait $pid",
      ProgramPath(),
      again,
      Path("m")));
  EXPECT_NE(killed.exit_code, 0);
  EXPECT_EQ(ReadBytes(dir_ / "m" / "images.bin"), before);
  EXPECT_EQ(RunCohort(again).exit_code, 0);
  EXPECT_EQ(ReadBytes(dir_ / "m" / "images.bin"), before);
}

TEST_F(Commands, ReconstructSaysInOneLineWhatTheTracksLack) {
  const std::string images = WriteImages(Path("images"), 5);
  const auto reconstruct = [&](const std::string& rows, const std::string& more = "") {
    WriteText(Path("t.csv"), "track_id,frame,x,y\n" + rows);
    EXPECT_EQ(RunCohort("import " + Path("t.csv") + " --images " + images + more +
                        " --quiet --out " + Path("t.tracks"))
                  .exit_code,
              0);
    return RunCohort("reconstruct " + Path("t.tracks") + " --quiet --out " + Path("m"));
  };
  ExpectFailure(reconstruct("0,0,50,50\n1,1,60,50\n2,4,70,50\n"),
                1,
                HasSubstr("none of 3 tracks is observed in 3 frames"));
  ExpectFailure(reconstruct("0,0,50,50\n", " --frames 0:1"), 1, HasSubstr("the clip has 1 frame"));
  std::string still;
  for (int track = 0; track < 20; ++track) {
    for (int frame = 0; frame < 5; ++frame) {
      still += fmt::format("{},{},{},{}\n", track, frame, 10 + 7 * track, 20 + 31 * track % 80);
    }
  }
  ExpectFailure(reconstruct(still), 1, HasSubstr("static camera"));
  EXPECT_EQ(ReadJson(dir_ / "m" / "summary.json")["registered"], 0);
}

TEST_F(Commands, RefineMeasuresTracksAgainWhereTheModelSaysTheyAre) {
  const auto path = [this](const char* name) { return Path(name); };
  Run("synth " + path("clip") + kMedium + " --frames 24");
  Run("degrade " + path("clip") + " " + path("dark") + " --level medium");
  Run("track " + path("dark") + " --features 150 --second-pass off --out " + path("a.tracks"));
  Run("reconstruct " + path("a.tracks") + " --out " + path("first"));
  const std::string refine = "refine " + path("a.tracks") + " --out " + path("b.tracks");
  Run(refine + " --model " + path("first") + " --json " + path("r.json"));
  Run("reconstruct " + path("b.tracks") + " --out " + path("second"));

  const auto figures = ReadJson(path("r.json"));
  EXPECT_GT(figures["regained"], 0);
  EXPECT_GT(figures["kept"].get<int>(), figures["observations_before"].get<int>() * 3 / 4);
  const auto ate = [&](const char* model) {
    Run("evaluate " + path(model) + " --truth " + path("clip") + " --json " + path("e.json"));
    return ReadJson(path("e.json"))["ate_m"].get<double>();
  };
  EXPECT_LT(ate("second"), ate("first"));

  // `track` does the same by itself, with a model that is not brought to the last minimum.
  Run("track " + path("dark") + " --features 150 --out " + path("c.tracks"));
  const TrackFile by_refine = ReadTrackFile(path("b.tracks"));
  const TrackFile by_track = ReadTrackFile(path("c.tracks"));
  EXPECT_TRUE(by_track.meta.second_pass);
  const auto observed = static_cast<double>(by_refine.tracks.CountObserved());
  EXPECT_NEAR(static_cast<double>(by_track.tracks.CountObserved()), observed, 0.01 * observed);
  EXPECT_GT(by_track.tracks.CountPredicted(), 0u);

  const std::string images = WriteImages(path("images"), 24);
  ExpectFailure(RunCohort(refine + " --model " + path("first") + " --images " + images),
                1,
                HasSubstr("give the same clip"));
  ExpectFailure(RunCohort(refine + " --model " + path("nothing")), 1, HasSubstr("nothing"));
  ExpectFailure(RunCohort(refine + " --model " + path("first") + " --ceres.covariances=off"),
                2,
                HasSubstr("--ceres.covariances is for a COLMAP model"));
}

// Nothing is measured in it, now or when the result is refined once more, and that is said.
TEST_F(Commands, RefineDropsWhatTheMaskCoversAndNotesIt) {
  Run("synth " + Path("clip") + kMedium + " --frames 12");
  Run("track " + Path("clip") + " --features 100 --second-pass off --out " + Path("a.tracks"));
  Run("reconstruct " + Path("a.tracks") + " --out " + Path("model"));
  cv::Mat mask(240, 320, CV_8UC1, cv::Scalar(0));
  cv::imwrite(Path("black.png"), mask);
  mask.at<std::uint8_t>(0, 0) = 255;
  cv::imwrite(Path("corner.png"), mask);
  mask.colRange(160, 320) = 255;
  cv::imwrite(Path("half.png"), mask);
  const std::string refine =
      "refine " + Path("a.tracks") + " --model " + Path("model") + " --quiet";
  ExpectFailure(RunCohort(refine + " --mask " + Path("black.png") + " --out " + Path("b.tracks")),
                1,
                HasSubstr("black.png is entirely black"));
  ExpectFailure(RunCohort(refine + " --mask " + Path("corner.png") + " --out " + Path("b.tracks")),
                1,
                AllOf(HasSubstr("corner.png covers all"), HasSubstr("tracks")));
  EXPECT_FALSE(fs::exists(Path("b.tracks")));
  Run(refine + " --mask " + Path("half.png") + " --json " + Path("r.json") + " --out " +
      Path("b.tracks"));
  EXPECT_GT(ReadJson(Path("r.json"))["masked_tracks"], 10);
  EXPECT_EQ(ReadTrackFile(Path("b.tracks")).meta.mask, Path("half.png"));
  Run("reconstruct " + Path("b.tracks") + " --out " + Path("half"));
  Run("refine " + Path("b.tracks") + " --model " + Path("half") + " --out " + Path("c.tracks"));
  const TrackFile again = ReadTrackFile(Path("c.tracks"));
  EXPECT_GT(again.tracks.CountObserved(), 100u);
  EXPECT_TRUE(std::ranges::all_of(again.tracks.observations(),
                                  [](const Observation& o) { return o.xy.x() > 157.0; }));

  // As of a COLMAP model.
  const std::string colmap = "refine --model " + Path("model") + " --images " + Path("clip") +
                             " --quiet --out " + Path("refined") + " --mask ";
  ExpectFailure(RunCohort(colmap + Path("corner.png")), 1, HasSubstr("the mask covers all of its"));
  ASSERT_EQ(RunCohort(colmap + Path("half.png")).exit_code, 0);
  EXPECT_EQ(ReadTrackFile(Path("refined/clip.tracks")).meta.mask, Path("half.png"));
  EXPECT_GT(ReadJson(Path("refined/summary.json"))["masked_tracks"], 10);
}

TEST_F(Commands, ExportReplacesNoDatabaseWithFeaturesOfColmaps) {
  const std::string clip = WriteImages(Path("clip"), 5);
  ASSERT_EQ(RunCohort(Track(clip)).exit_code, 0);
  const std::string to_database =
      "export " + Path("a.tracks") + " --quiet --colmap-database " + Path("a.db");
  ASSERT_EQ(RunCohort(to_database).exit_code, 0);
  ASSERT_EQ(RunCohort(to_database).exit_code, 0) << "its own is replaced";
  SqliteDatabase::Open(Path("a.db"), SqliteDatabase::Mode::kCreate)
      .Execute("INSERT INTO descriptors VALUES(1, 2, 128, zeroblob(256))");
  const std::string before = ReadBytes(Path("a.db"));
  ExpectFailure(RunCohort(to_database),
                1,
                AllOf(HasSubstr("a.db has features of 1 images"), HasSubstr("another name")));
  EXPECT_EQ(ReadBytes(Path("a.db")), before);
}

// Whose images have other numbers than their frames.
TEST_F(Commands, RefinesAColmapModelIntoTheSameModelMeasuredAgain) {
  Run("synth " + Path("clip") + kMedium + " --frames 24");
  Run("degrade " + Path("clip") + " " + Path("dark") + " --level medium");
  Run("track " + Path("dark") + " --tracker klt --features 150 --out " + Path("klt.tracks"));
  Run("reconstruct " + Path("klt.tracks") + " --out " + Path("first"));
  const ColmapModel first = ReadColmapModel(dir_ / "first");
  ColmapModel renumbered = first;
  renumbered.images.clear();
  for (const auto& [id, image] : first.images) renumbered.images[1000 - id] = image;
  for (auto& [id, point] : renumbered.points) {
    for (auto& [image, index] : point.track) image = 1000 - image;
  }
  fs::create_directory(dir_ / "sparse");
  WriteColmapModel(dir_ / "sparse", renumbered, ColmapModelFormat::kBinary);
  const std::string refine = "refine --model " + Path("sparse") + " --out " + Path("refined");
  Run(refine + " --images " + Path("dark") + " --json " + Path("r.json"));
  for (const char* name : {"cameras.bin",
                           "images.bin",
                           "points3D.bin",
                           "points.ply",
                           "trajectory.tum",
                           "clip.tracks",
                           "point_covariances.csv"}) {
    EXPECT_TRUE(fs::exists(dir_ / "refined" / name)) << name;
  }
  const auto ate = [&](const char* model) {
    Run("evaluate " + Path(model) + " --truth " + Path("clip") + " --json " + Path("e.json"));
    const auto figures = ReadJson(Path("e.json"));
    EXPECT_EQ(figures["registered"], 24) << model;
    return figures["ate_m"].get<double>();
  };
  const double before = ate("first");
  EXPECT_DOUBLE_EQ(ate("sparse"), before) << "found by the names of the images";
  EXPECT_LT(ate("refined"), 0.7 * before);
  ExpectFailure(
      RunCohort("evaluate " + Path("first") + " --truth " + Path("clip") + " --edge-px 60"),
      2,
      HasSubstr("--edge-px is for tracks"));
  EXPECT_GT(ReadJson(Path("r.json"))["tracks_measured_again"], 100);
  const Reconstruction by_frame = ReadModelFolder(dir_ / "refined");
  ASSERT_EQ(by_frame.frame_names.size(), 24u);
  std::int64_t last_ns = -1;
  for (const auto& [frame, name] : by_frame.frame_names) {
    EXPECT_EQ(name, first.images.at(ToInt(frame) + 1).name);
    EXPECT_LT(last_ns, by_frame.timestamps_ns.at(frame)) << name;
    last_ns = by_frame.timestamps_ns.at(frame);
  }
  // With their neighbours' cameras the points would not be where they are seen.
  std::vector<double> distances_px;
  for (const auto& [feature, point] : by_frame.points) {
    for (const PointView& view : point.views) {
      const auto xy =
          by_frame.camera.Project(by_frame.cam_from_world.at(view.frame) * point.in_world);
      ASSERT_TRUE(xy);
      distances_px.push_back((*xy - view.xy).norm());
    }
  }
  EXPECT_LT(Median(distances_px), 0.5);

  // A model without the clip's last frames does not lose them by being refined.
  ColmapModel cut = renumbered;
  const auto is_gone = [](const auto& of_image) { return of_image.first < 1000 - 15; };
  std::erase_if(cut.images, is_gone);
  for (auto& [id, point] : cut.points) {
    std::erase_if(point.track, is_gone);
  }
  std::erase_if(cut.points, [](const auto& point) { return point.second.track.size() < 3; });
  for (auto& [id, image] : cut.images) {
    for (auto& point2d : image.points2d) {
      if (point2d.point3d && !cut.points.contains(*point2d.point3d)) point2d.point3d.reset();
    }
  }
  fs::create_directory(dir_ / "cut");
  WriteColmapModel(dir_ / "cut", cut, ColmapModelFormat::kBinary);
  Run("refine --model " + Path("cut") + " --out " + Path("whole") + " --images " + Path("dark"));
  Run("evaluate " + Path("whole") + " --truth " + Path("clip") + " --json " + Path("e.json"));
  EXPECT_EQ(ReadJson(Path("e.json"))["registered"], 15);
  EXPECT_EQ(ReadJson(Path("e.json"))["frames"], 24);
  EXPECT_EQ(ReadJson(Path("e.json"))["why_failed"], "15 of 24 frames have a pose, fewer than 80 %");
  ExpectFailure(RunCohort(refine + " --images " + Path("dark") + " --max-distance-px 4"),
                2,
                HasSubstr("--model-max-distance-px"));

  // Of every third frame: no more were to be had, and they are the clip's 0, 3, 6 ...
  fs::create_directory(dir_ / "thin");
  for (std::uint32_t i = 0; i < 24; i += 3) {
    fs::copy(dir_ / "dark" / first.images.at(i + 1).name, dir_ / "thin");
  }
  Run(refine + " --images " + Path("thin"));
  Run("evaluate " + Path("refined") + " --truth " + Path("clip") + " --json " + Path("e.json"));
  const auto thin = ReadJson(Path("e.json"));
  EXPECT_EQ(thin["registered"], 8);
  EXPECT_EQ(thin["frames"], 8);
  EXPECT_EQ(thin["failed"], false);
  EXPECT_LT(thin["ate_m"], 2.0 * before);

  ExpectFailure(RunCohort(refine), 2, HasSubstr("give --images INPUT, or the .tracks file"));
  ExpectFailure(RunCohort(refine + " --images " + WriteImages(Path("images"), 3).string()),
                1,
                HasSubstr(Path("sparse")));
}

// One rigid model cannot say where the points of several bodies are.
TEST_F(Commands, WhatTheModelDoesNotFindAgainStaysWhereTheSceneIsNotRigid) {
  Run("synth " + Path("clip") + kMedium + " --scene bodies --frames 24");
  const std::string track = "track " + Path("clip") + " --features 150 --out ";
  const ProgramEnd two = RunCohort(track + Path("two.tracks"));
  EXPECT_EQ(two.exit_code, 0) << two.err;
  EXPECT_THAT(two.err, HasSubstr("tracks not found again are kept unchanged"));
  EXPECT_EQ(RunCohort(track + Path("one.tracks") + " --second-pass off").exit_code, 0);
  const TrackFile kept = ReadTrackFile(Path("two.tracks"));
  const TrackFile first = ReadTrackFile(Path("one.tracks"));
  EXPECT_TRUE(kept.meta.second_pass);
  EXPECT_GT(kept.tracks.CountObserved(), first.tracks.CountObserved() * 9 / 10);
}

TEST_F(Commands, FlagsAreOnOrOff) {
  const auto uncentered = [&](const std::string& flag) {
    const ProgramEnd end = RunCohort("track x --out y --dump-config " + flag);
    EXPECT_EQ(end.exit_code, 0) << end.err;
    return nlohmann::json::parse(end.out).at("subspace").at("uncentered").get<bool>();
  };
  for (const char* flag :
       {"--uncentered", "--uncentered=on", "--uncentered=1", "--no-uncentered=off"}) {
    EXPECT_TRUE(uncentered(flag)) << flag;
  }
  for (const char* flag :
       {"--no-uncentered", "--uncentered=off", "--uncentered=no", "--no-uncentered=yes"}) {
    EXPECT_FALSE(uncentered(flag)) << flag;
  }
  ExpectFailure(RunCohort("track x --out y --uncentered=banana"),
                2,
                AllOf(HasSubstr("--uncentered 'banana'"), HasSubstr("on or off")));
}

TEST_F(Commands, AWordInBracketsIsAName) {
  ExpectFailure(RunCohort("show '[a,b]' --out " + Path("f.html")), 1, HasSubstr("[a,b]"));
}

// Tracks that were made of arrays.
TEST_F(Commands, ExportsTracksWhosePicturesCameFromNoFile) {
  const std::string clip = WriteImages(Path("clip"), 3);
  Run("track " + clip + " --tracker klt --out " + Path("of_files.tracks"));
  TrackFile file = ReadTrackFile(Path("of_files.tracks"));
  file.source.clear();
  file.image_root.clear();
  WriteTrackFile(Path("f.tracks"), file);
  const ProgramEnd end =
      RunCohort("export " + Path("f.tracks") + " --colmap-database " + Path("f.db"));
  EXPECT_EQ(end.exit_code, 0) << end.err;
  EXPECT_THAT(end.out, Not(HasSubstr("image_path")));
  ExpectFailure(RunCohort("show " + Path("f.tracks") + " --out " + Path("f.html")),
                1,
                HasSubstr("give them by --images"));
  Run("show " + Path("f.tracks") + " --images " + clip + " --out " + Path("f.html"));
}

TEST_F(Commands, OpensTheClipAgainAsItsTracksWereMade) {
  const std::string clip = WriteImages(Path("clip"), 5);
  WriteBytes(ImagePath(clip, 0), "no picture");
  Run("track " + clip + "/ --frames 1: --tracker klt --out " + Path("f.tracks"));
  Run("show " + Path("f.tracks") + " --out " + Path("f.html"));
  EXPECT_THAT(ReadBytes(Path("f.html")), HasSubstr("\"title\":\"clip\""));
}

TEST_F(Commands, AKilledRunLeavesTheOldTracks) {
  Run("synth " + Path("clip") + kSmall + " --frames 8");
  Run(Track(Path("clip")));
  const std::string before = ReadBytes(Path("a.tracks"));
  WriteImages(Path("long"), 200);
  const ProgramEnd end =
      RunShell(fmt::format("{} {} --quiet & pid=$!; sleep 0.2; kill -KILL $pid; wait $pid",
                           ProgramPath(),
                           Track(Path("long"))));
  EXPECT_EQ(end.exit_code, 128 + SIGKILL);
  EXPECT_EQ(ReadBytes(Path("a.tracks")), before);
}

TEST_F(Commands, SaysThatTheClipWasReplacedWhileItWasTracked) {
  const std::string clip = WriteImages(Path("clip"), 5);
  InputOptions input;
  input.input = clip;
  const auto sequence = OpenInput(input);
  TrackFile file = TrackFirstPass(*sequence);
  DescribeInput(input, *sequence, file);
  EXPECT_EQ(WarningOfClip(*sequence, file, clip), "");
  fs::copy(ImagePath(clip, 0), ImagePath(clip, 4), fs::copy_options::overwrite_existing);
  EXPECT_THAT(WarningOfClip(*sequence, file, clip), HasSubstr("clip changed while it was read"));
}

TEST_F(Commands, SaysThatTheClipIsNotWhatItWasWhenItWasTracked) {
  Run("synth " + Path("clip") + kMedium + " --frames 12");
  Run("synth " + Path("other") + kMedium + " --frames 12 --seed 4");
  Run("track " + Path("clip") + " --features 150 --second-pass off --out " + Path("a.tracks"));
  Run("reconstruct " + Path("a.tracks") + " --out " + Path("m"));
  const std::string refine =
      "refine " + Path("a.tracks") + " --model " + Path("m") + " --quiet --out " + Path("b.tracks");
  EXPECT_EQ(RunCohort(refine).err, "");
  fs::rename(Path("clip"), Path("moved"));
  fs::rename(Path("other"), Path("clip"));
  EXPECT_THAT(RunCohort(refine).err, HasSubstr("clip has changed since"));
  EXPECT_EQ(RunCohort(refine + " --images " + Path("moved")).err, "");

  const std::string video = WriteVideo(Path("v.avi"), 8);
  ASSERT_EQ(RunCohort(Track(video)).exit_code, 0);
  WriteVideo(video, 9);
  EXPECT_THAT(RunCohort("export " + Path("a.tracks") + " --colmap-database " + Path("c.db")).err,
              HasSubstr("v.avi has changed since"));
}

TEST_F(Commands, SaysThatTheModelIsOfOtherTracks) {
  for (const std::string clip : {"a", "b"}) {
    const std::string seed = clip == "a" ? " --seed 1" : " --seed 2";
    Run("synth " + Path(clip) + kMedium + " --frames 12" + seed);
    Run("track " + Path(clip) + " --features 150 --out " + Path(clip + ".tracks"));
    Run("reconstruct " + Path(clip + ".tracks") + " --out " + Path(clip + ".model"));
  }
  const auto problem_of = [this](const std::string& model) {
    return RunCohort("export " + Path("a.tracks") + " --model " + Path(model) + " --quiet --bal " +
                     Path("a.bal"));
  };
  EXPECT_EQ(problem_of("a.model").err, "");
  const std::string of_others = problem_of("b.model").err;
  EXPECT_THAT(
      of_others,
      testing::AnyOf(HasSubstr("was made from other tracks than"), HasSubstr("is not a track")));
  // Measured again where the model says they are, they are still its tracks.
  Run("refine " + Path("a.tracks") + " --model " + Path("a.model") + " --out " +
      Path("./a.tracks"));
  EXPECT_EQ(problem_of("a.model").err, "");
}

TEST_F(Commands, ExportOfAPieceReplacesThePicturesOfTheWhole) {
  const std::string video = WriteVideo(Path("v.avi"), 8);
  const std::string to_colmap =
      "export " + Path("a.tracks") + " --quiet --colmap-database " + Path("c.db");
  Run(Track(video));
  Run(to_colmap);
  Run(Track(video, "--frames 0:4"));
  Run(to_colmap);
  EXPECT_TRUE(fs::exists(Path("c_images/frame_000003.png")));
  EXPECT_FALSE(fs::exists(Path("c_images/frame_000004.png")));
  // Another's picture is in the way: nothing is replaced.
  WriteText(Path("c_images/mine.png"), "mine");
  const std::string before = ReadBytes(Path("c.db"));
  Run(Track(video));
  ExpectFailure(RunCohort(to_colmap), 1, HasSubstr("mine.png"));
  EXPECT_EQ(ReadBytes(Path("c.db")), before);
}

// A slip of the hand loses nothing.
TEST_F(Commands, NoOutputTakesThePlaceOfAnInput) {
  const std::string clip = Path("clip");
  Run("synth " + clip + kSmall + " --frames 8");
  const std::string video = WriteVideo(Path("v.avi"), 8);
  ASSERT_EQ(RunCohort(Track(clip)).exit_code, 0);
  const std::string tracks = Path("a.tracks");
  ASSERT_EQ(RunCohort("export " + tracks + " --csv " + Path("a.csv") + " --quiet").exit_code, 0);
  cv::imwrite(Path("mask.png"), cv::Mat(120, 160, CV_8UC1, cv::Scalar(255)));
  WriteText(Path("config.json"), "{}");
  const std::string model = Path("model");
  ASSERT_EQ(RunCohort("reconstruct " + tracks + " --quiet --out " + model).exit_code, 0);
  WriteText(model + "/images.txt", "the same as text, which is not read");
  const std::string depth = clip + "/depth/000003.png";
  ASSERT_TRUE(fs::exists(depth));
  const auto all_bytes = [&] {
    std::map<std::string, std::string> bytes;
    for (const auto& entry : fs::recursive_directory_iterator(dir_.path())) {
      if (entry.is_regular_file()) bytes[entry.path().string()] = ReadBytes(entry.path());
    }
    return bytes;
  };
  const auto before = all_bytes();
  const std::string options = " --tracker klt --features 30 --quiet ";
  const std::vector<std::string> onto_inputs{
      "track " + video + options + "--out " + video,
      "track " + clip + options + "--out " + clip + "/rgb.txt",
      "track " + clip + options + "--out " + clip + "/rgb/000001.png",
      "track " + clip + options + "--mask " + Path("mask.png") + " --out " + Path("mask.png"),
      "track " + clip + options + "--config " + Path("config.json") + " --out " +
          Path("config.json"),
      "export " + tracks + " --csv " + tracks,
      "export " + tracks + " --colmap-database " + tracks,
      "import " + Path("a.csv") + " --images " + clip + " --out " + Path("a.csv"),
      "evaluate " + tracks + " --truth " + clip + " --json " + tracks,
      "evaluate " + tracks + " --truth " + clip + " --json " + clip + "/groundtruth.txt",
      "evaluate " + model + " --truth " + clip + " --json " + model + "/summary.json",
      "evaluate " + model + " --truth " + clip + " --json " + model + "/images.txt",
      "evaluate " + model + " --truth " + clip + " --json " + depth,
      "refine " + tracks + " --model " + model + " --out " + Path("r.tracks") + " --json " + model +
          "/summary.json",
      "refine --model " + model + " --images " + clip + " --out " + Path("r") + " --json " + model +
          "/summary.json",
      "degrade " + clip + "/rgb " + clip,
      "degrade '" + clip + "/rgb/*.png' " + clip,
  };
  for (const std::string& line : onto_inputs) {
    ExpectFailure(RunCohort(line), 1, HasSubstr("this run reads"));
    EXPECT_EQ(all_bytes(), before) << line;
  }
  const std::vector<std::string> twice{
      "track " + clip + options + "--out " + Path("b") + " --json " + Path("b"),
      "export " + tracks + " --csv " + Path("b") + " --npz " + Path("b"),
  };
  for (const std::string& line : twice) {
    ExpectFailure(RunCohort(line), 2, HasSubstr("are both"));
  }
  EXPECT_EQ(all_bytes(), before);
  // What a run has made is its own to make again.
  EXPECT_EQ(RunCohort(Track(clip)).exit_code, 0);
}

TEST_F(Commands, CompareRemovesNoCellsButItsOwn) {
  const std::string clip = WriteImages(Path("clip"), 8);
  fs::create_directories(Path("out/cells"));
  WriteText(Path("out/cells/microscope.tif"), "precious");
  const std::string options = " --trackers klt --backends ceres --features 30 --quiet --out ";
  ExpectFailure(
      RunCohort("compare " + clip + options + Path("out")),
      1,
      AllOf(HasSubstr("out/cells is where the cells belong"), HasSubstr("give another --out")));
  EXPECT_EQ(ReadBytes(Path("out/cells/microscope.tif")), "precious");
  fs::create_directories(Path("other"));
  fs::rename(clip, Path("other/cells"));
  ExpectFailure(RunCohort("compare " + Path("other/cells") + options + Path("other")),
                1,
                HasSubstr("this run reads"));
  EXPECT_TRUE(fs::exists(ImagePath(Path("other/cells"), 7)));
}

// A file that may not grow is a disk that is full, without root.
TEST_F(Commands, AFileThatMayNotGrowIsOneLineAndTheOldOneStays) {
  const std::string clip = WriteImages(Path("clip"), 8);
  ASSERT_EQ(RunCohort(Track(clip)).exit_code, 0);
  for (const char* name : {"old.csv", "old.npz", "old.db", "old.mp4"}) WriteText(Path(name), "old");
  const std::string limited = std::string("ulimit -f 1; ") + ProgramPath() + " ";
  const std::string tracks = Path("a.tracks");
  for (const std::string& line : {"export " + tracks + " --csv " + Path("old.csv"),
                                  "export " + tracks + " --npz " + Path("old.npz"),
                                  "export " + tracks + " --colmap-database " + Path("old.db"),
                                  "show " + tracks + " --quiet --out " + Path("old.mp4")}) {
    ExpectFailure(RunShell(limited + line), 1, HasSubstr("old."));
  }
  for (const char* name : {"old.csv", "old.npz", "old.db", "old.mp4"}) {
    EXPECT_EQ(ReadBytes(Path(name)), "old") << name;
  }
  for (const auto& entry : fs::directory_iterator(dir_.path())) {
    EXPECT_EQ(entry.path().string().find(".partial"), std::string::npos) << entry.path();
  }
}

TEST_F(Commands, CompareMeasuresEveryCellAndResumes) {
  Run("synth " + Path("clip") + kSmall + " --frames 8");
  const std::string compare = "compare " + Path("clip") +
                              " --trackers klt,subspace --backends ceres --levels clean "
                              "--features 80 --jobs 2 --out " +
                              Path("out");
  const ProgramEnd first = RunCohort(compare);
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_THAT(first.out, AllOf(HasSubstr("subspace"), HasSubstr("clean"), HasSubstr("registered")));
  EXPECT_THAT(ReadBytes(Path("out/results.csv")),
              StartsWith("sequence,level,tracker,backend,seed,metric,value,unit\n"
                         "clip,clean,klt,,1,failed,0,\n"));
  const ProgramEnd second = RunCohort(compare + " --resume");
  EXPECT_EQ(second.out, first.out);
  EXPECT_THAT(second.err, HasSubstr("reconstruct: 2 of 2 are done already"));
  // What is damaged is made anew, or left out where it only illustrates.
  int damaged = 0;
  for (const auto& entry : fs::recursive_directory_iterator(Path("out/cells"))) {
    const std::string name = entry.path().filename().string();
    if (entry.path().extension() != ".json" || name.starts_with("clip")) continue;
    WriteText(entry.path().string(), "nonsense");
    ++damaged;
  }
  EXPECT_GT(damaged, 4);
  const ProgramEnd mended = RunCohort(compare + " --resume");
  EXPECT_EQ(mended.exit_code, 0);
  EXPECT_THAT(mended.err, HasSubstr("it is run again"));
  // Interrupted before its first cell, and begun anew.
  fs::remove_all(Path("out/cells/clip"));
  fs::remove(Path("out/cells/clip0.json"));
  const ProgramEnd anew = RunCohort(compare);
  EXPECT_EQ(anew.exit_code, 0) << anew.err;
  EXPECT_THAT(ReadBytes(Path("out/results.csv")),
              HasSubstr("clip,clean,subspace,ceres,1,registered"));

  // Shards in one folder, at the same time, give the whole.
  ExpectFailure(RunCohort(compare + "2 --collect --quiet"), 1, HasSubstr("no cell of this grid"));
  ASSERT_EQ(RunCohort(compare + "2 --shard 1/2").exit_code, 0);
  EXPECT_THAT(RunCohort(compare + "2 --collect").err, HasSubstr("1 of 2 cells are not finished"));
  fs::remove_all(Path("out2"));
  const std::string shard = ProgramPath() + " " + compare + "2 --shard ";
  const ProgramEnd shards = RunShell(shard + "0/2 & first=$!; " + shard + "1/2 && wait $first");
  ASSERT_EQ(shards.exit_code, 0) << shards.err;
  const std::string of_the_last = ReadBytes(Path("out2/results.csv"));
  const ProgramEnd collect = RunCohort(compare + "2 --collect");
  EXPECT_THAT(collect.err, Not(HasSubstr("not finished")));
  EXPECT_EQ(ReadBytes(Path("out2/results.csv")), of_the_last);
  const auto without_times = [](const std::string& csv) {
    std::istringstream in(csv);
    std::string kept;
    for (std::string line; std::getline(in, line);) {
      if (line.find("time") == std::string::npos && line.find("seconds") == std::string::npos) {
        kept += line + "\n";
      }
    }
    return kept;
  };
  EXPECT_EQ(without_times(ReadBytes(Path("out2/results.csv"))),
            without_times(ReadBytes(Path("out/results.csv"))));
}

// A dark clip, with what bounds every tracker (the ceiling), what isolates tracks from the solver
// (triangulation) and the second pass, which any tracker's tracks can have.
TEST_F(Commands, ComparesWithTheCeilingAndTheTrueCameras) {
  Run("synth " + Path("clip") + kMedium + " --frames 16");
  const std::string compare = "compare " + Path("clip") +
                              " --trackers klt,klt-refined,anchored-klt15,ceiling --backends "
                              "ceres,triangulation --features "
                              "150 --jobs 2 --out " +
                              Path("out") + " --levels ";
  const ProgramEnd end = RunCohort(compare + "medium");
  ASSERT_EQ(end.exit_code, 0) << end.err;
  const auto json = ReadJson(Path("out/results.json"));
  EXPECT_EQ(json["failures"].size(), 0u) << end.out;
  EXPECT_EQ(json["not_available"].size(), 0u);
  std::map<std::string, double> values;
  for (const auto& row : json["rows"]) {
    values[fmt::format("{} {} {}",
                       row["tracker"].get<std::string>(),
                       row["backend"].get<std::string>(),
                       row["metric"].get<std::string>())] = row["value"];
  }
  EXPECT_LT(values.at("ceiling ceres ate"), values.at("klt ceres ate"));
  EXPECT_LT(values.at("ceiling triangulation point_error_median"),
            0.5 * values.at("klt triangulation point_error_median"));
  EXPECT_LT(values.at("ceiling  observed_error_median"),
            values.at("anchored-klt15  observed_error_median"));
  EXPECT_GT(values.at("ceiling  mean_track_length"), values.at("klt  mean_track_length"));
  EXPECT_GT(values.at("klt-refined  mean_track_length"), values.at("klt  mean_track_length"));
  EXPECT_FALSE(values.contains("klt ceres halves_failed"));  // there are true cameras
  EXPECT_FALSE(values.contains("klt triangulation ate"));    // its cameras are the truth

  // The noise of a clip as it is is unknown, and with it the ceiling: no failure of a tracker.
  const ProgramEnd as_is = RunCohort(compare + "as-is");
  ASSERT_EQ(as_is.exit_code, 0) << as_is.err;
  EXPECT_THAT(as_is.out,
              AllOf(HasSubstr("not available: clip as-is ceiling"), Not(HasSubstr("FAILED"))));
  EXPECT_EQ(ReadJson(Path("out/results.json"))["not_available"].size(), 1u);
}

TEST_F(Commands, CompareJudgesAClipWithoutTrueCamerasByTheHalvesOfItsTracks) {
  Run("synth " + Path("clip") + kMedium + " --frames 16");
  const std::string compare = "compare " + Path("clip/rgb") +
                              " --camera 260,260,159.5,119.5 --trackers klt,subspace --backends "
                              "ceres --features 150 --out " +
                              Path("out");
  const ProgramEnd end = RunCohort(compare);
  ASSERT_EQ(end.exit_code, 0) << end.err;
  EXPECT_THAT(end.out, AllOf(HasSubstr("halves"), HasSubstr("in both"), Not(HasSubstr("ATE"))));
  const auto json = ReadJson(Path("out/results.json"));
  EXPECT_EQ(json["failures"].size(), 0u) << end.out;
  std::map<std::string, double> apart;
  for (const auto& row : json["rows"]) {
    if (row["metric"] == "halves_frames") {
      EXPECT_EQ(row["value"], 1.0);
    }
    if (row["metric"] == "halves_disagreement") apart[row["tracker"]] = row["value"];
  }
  ASSERT_EQ(apart.size(), 2u);
  for (const auto& [tracker, value] : apart) {
    EXPECT_GT(value, 0.0) << tracker;
    EXPECT_LT(value, 0.1) << tracker;
  }
  const ProgramEnd again = RunCohort(compare + " --resume");
  EXPECT_EQ(again.out, end.out);
  EXPECT_THAT(again.err, HasSubstr("halves: 2 of 2 are done already"));
  EXPECT_THAT(RunCohort(compare + " --resume --no-halves").out, Not(HasSubstr("halves")));
  // A shard that was killed on its way.
  EXPECT_THAT(RunCohort(compare + " --collect").err, Not(HasSubstr("not finished")));
  ASSERT_TRUE(fs::remove(Path("out/cells/rgb/as-is/1/klt/ceres_halves.json")));
  EXPECT_THAT(RunCohort(compare + " --collect").err, HasSubstr("1 of 2 cells are not finished"));
}

TEST_F(Commands, CompareDoesAgainWhatAChangedClipMakesStale) {
  const std::string clip = WriteImages(Path("clip"), 6);
  const std::string compare =
      "compare " + clip + " --trackers klt --backends ceres --out " + Path("out") + " --resume";
  ASSERT_EQ(RunCohort(compare).exit_code, 0);
  EXPECT_THAT(RunCohort(compare).err, HasSubstr("track: 1 of 1 are done already"));
  EXPECT_THAT(RunCohort(compare + " --frames 0:5").err,
              Not(HasSubstr("track: 1 of 1 are done already")));
  ASSERT_EQ(RunCohort(compare).exit_code, 0);
  cv::imwrite(ImagePath(clip, 3), MovingFrame(40));
  EXPECT_THAT(RunCohort(compare).err, Not(HasSubstr("track: 1 of 1 are done already")));

  // What cannot be tracked to its end is not reconstructed from the frames until then.
  cv::imwrite(ImagePath(clip, 3), MovingFrame(3, CV_8U, {150, 120}));
  ASSERT_EQ(RunCohort(compare).exit_code, 0);
  const nlohmann::json failures = ReadJson(Path("out/results.json"))["failures"];
  ASSERT_EQ(failures.size(), 2u);
  EXPECT_THAT(failures[0]["reason"], HasSubstr("150x120"));
  EXPECT_THAT(failures[1]["reason"], StartsWith("tracking failed: "));
}

TEST_F(Commands, CompareTakesNoCellOfAnotherClipOrOfOtherOptions) {
  Run("synth " + Path("clip") + kSmall + " --frames 8");
  const auto compare = [this](const std::string& more) {
    return RunCohort("compare " + Path("clip") +
                     " --trackers klt,subspace --backends triangulation --levels clean --quiet "
                     "--out " +
                     Path("grid") + more);
  };
  const auto frames_of_cells = [this] {
    std::vector<double> frames;
    const nlohmann::json results = ReadJson(Path("grid/results.json"));
    for (const auto& row : results.at("rows")) {
      if (row.at("metric") == "frames") frames.push_back(row.at("value"));
    }
    return frames;
  };
  ASSERT_EQ(compare(" --features 30").exit_code, 0);
  EXPECT_EQ(frames_of_cells(), std::vector<double>(2, 8.0));
  // Other options: nothing of it is there.
  ExpectFailure(compare(" --features 20 --collect"), 1, HasSubstr("no cell of this grid"));
  // Another clip of that name, half of it done.
  fs::remove_all(Path("clip"));
  Run("synth " + Path("clip") + kSmall + " --frames 10 --seed 9");
  const ProgramEnd half = compare(" --features 30 --shard 0/2 --resume");
  ASSERT_EQ(half.exit_code, 0) << half.err;
  EXPECT_EQ(frames_of_cells(), std::vector<double>(1, 10.0));
  ASSERT_EQ(compare(" --features 30 --shard 1/2 --resume").exit_code, 0);
  EXPECT_EQ(frames_of_cells(), std::vector<double>(2, 10.0));
  // What lies beside a shard of other options is not drawn as if it were of these.
  ASSERT_EQ(compare(" --features 25 --shard 0/2 --resume").exit_code, 0);
  EXPECT_EQ(frames_of_cells(), std::vector<double>(1, 10.0));
  const std::string page = ReadBytes(Path("grid/report.html"));
  const std::size_t begin = page.find('>', page.find("id=\"data\"")) + 1;
  const auto data =
      nlohmann::json::parse(page.substr(begin, page.find("</script>", begin) - begin));
  EXPECT_EQ(data.at("calibration").size(), 0u);  // KLT has no covariances
  ASSERT_EQ(data.at("pictures").at("trackers").size(), 1u);
  EXPECT_EQ(data.at("pictures").at("trackers")[0].at("tracker"), "klt");
}

TEST_F(Commands, CompareMakesAnewWhatWasDeleted) {
  Run("synth " + Path("clip") + kSmall + " --frames 8");
  const auto compare = [this](const std::string& clip, const std::string& more) {
    return RunCohort("compare " + Path(clip) +
                     " --trackers klt --levels medium --features 30 --quiet --resume --out " +
                     Path("grid") + more);
  };
  ASSERT_EQ(compare("clip", " --backends triangulation").exit_code, 0);
  const fs::path cell = dir_ / "grid/cells/clip/medium/1";
  fs::remove(cell / "klt/clip.tracks");
  fs::remove_all(cell / "frames");
  const ProgramEnd end = compare("clip", " --backends triangulation,ceres");
  EXPECT_THAT(end.out, Not(HasSubstr("FAILED"))) << end.err;
  EXPECT_TRUE(fs::exists(cell / "klt/clip.tracks"));
  EXPECT_TRUE(fs::exists(cell / "frames"));
  // Another spelling of the clip is the same clip.
  const auto written = fs::last_write_time(cell / "klt/tracks.json");
  ASSERT_EQ(compare("grid/../clip", " --backends triangulation,ceres").exit_code, 0);
  EXPECT_EQ(fs::last_write_time(cell / "klt/tracks.json"), written);
}

TEST_F(Commands, CompareDoesAgainWhatAnotherProgramDid) {
  const std::string clip = WriteImages(Path("clip"), 6);
  const std::string compare =
      "compare " + clip + " --trackers klt --backends ceres --out " + Path("out") + " --resume";
  ASSERT_EQ(RunCohort(compare).exit_code, 0);
  EXPECT_THAT(RunCohort(compare).err, HasSubstr("track: 1 of 1 are done already"));
  // The same program but for one byte behind its end, which nothing reads.
  const std::string changed = Path("changed");
  fs::copy_file(ProgramPath(), changed);
  std::ofstream(changed, std::ios::app) << '\n';
  const ProgramEnd end = RunShell(changed + " " + compare);
  EXPECT_EQ(end.exit_code, 0) << end.err;
  EXPECT_THAT(end.err, Not(HasSubstr("done already")));
}

TEST_F(Commands, CompareTakesAGlobOfTheFolderItRunsIn) {
  const std::string clip = WriteImages(Path("clip"), 3);
  const ProgramEnd end =
      RunShell(fmt::format("cd {} && {} compare '*.png' --trackers klt --backends ceres --out {}",
                           clip,
                           ProgramPath(),
                           Path("out")));
  EXPECT_EQ(end.exit_code, 0) << end.err;
}

// What it writes there is not of the clip.
TEST_F(Commands, CompareGoesOnInTheFolderOfItsClip) {
  const std::string clip = WriteImages(Path("clip"), 3);
  for (const std::string input : {"'*.png'", "."}) {
    const auto compare = [&](const std::string& more) {
      return RunShell(
          fmt::format("cd {} && {} compare {} --trackers klt --backends ceres --out grid{}",
                      clip,
                      ProgramPath(),
                      input,
                      more));
    };
    ASSERT_EQ(compare("").exit_code, 0);
    EXPECT_THAT(compare(" --resume").err, HasSubstr("track: 1 of 1 are done already")) << input;
    const ProgramEnd collected = compare(" --collect");
    EXPECT_EQ(collected.exit_code, 0) << collected.err;
    fs::remove_all(Path("clip/grid"));
  }
}

TEST_F(Commands, AKilledCompareResumesAndGivesTheSame) {
  Run("synth " + Path("clip") + kSmall + " --frames 8");
  const auto compare = [this](const std::string& out) {
    return "compare " + Path("clip") +
           " --trackers klt,anchored-klt,subspace --backends ceres --levels clean --features 80 "
           "--quiet --resume --out " +
           Path(out);
  };
  ASSERT_EQ(RunCohort(compare("peace")).exit_code, 0);
  const ProgramEnd killed = RunShell(
      fmt::format("{} {} & pid=$!; while [ ! -f {} ]; do sleep 0.005; done; kill -9 $pid; wait "
                  "$pid",
                  ProgramPath(),
                  compare("hurt"),
                  Path("hurt/cells/clip/clean/1/klt/tracks.json")));
  EXPECT_EQ(killed.exit_code, 128 + SIGKILL);
  EXPECT_FALSE(fs::exists(Path("hurt/results.csv")));
  const ProgramEnd resumed = RunCohort(compare("hurt"));
  ASSERT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_EQ(resumed.out, RunCohort(compare("peace")).out);
}

TEST_F(Commands, ComparesAsThePaperDid) {
  Run("synth " + Path("clip") + kMedium + " --frames 8");
  const std::string compare = "compare " + Path("clip") +
                              " --protocol paper --paper.window-frames 4 --levels medium "
                              "--trackers klt7,rlof,descent-paper,subspace-paper,subspace --out " +
                              Path("out");
  const ProgramEnd first = RunCohort(compare);
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_THAT(first.out,
              AllOf(HasSubstr("mean L1 trajectory error after 4 frames"),
                    HasSubstr("frames between re-initialisations, subspace / tracker"),
                    Not(HasSubstr("FAILED"))));
  EXPECT_THAT(ReadBytes(Path("out/results.csv")), HasSubstr("l1_error_4_frames"));
  const ProgramEnd second = RunCohort(compare + " --resume");
  EXPECT_EQ(second.out, first.out);
  EXPECT_THAT(second.err, HasSubstr("follow: 5 of 5 are done already"));

  // A model of the other protocol that lies there is none of these.
  const std::string grid =
      "compare " + Path("clip") + " --levels medium --trackers klt7 --backends ceres --features 80";
  ASSERT_EQ(RunCohort(grid + " --out " + Path("grid")).exit_code, 0);
  ASSERT_EQ(
      RunCohort(grid + " --protocol paper --paper.window-frames 4 --resume --out " + Path("grid"))
          .exit_code,
      0);
  EXPECT_THAT(ReadBytes(Path("grid/results.csv")),
              AllOf(HasSubstr("l1_error_4_frames"), Not(HasSubstr("ceres"))));

  WriteImages(Path("images"), 3);
  ExpectFailure(
      RunCohort("compare " + Path("images") + " --protocol paper --quiet --out " + Path("out2")),
      1,
      HasSubstr("no true tracks"));
  ExpectFailure(RunCohort(compare + " --paper.window-frames 0"), 2, HasSubstr("window-frames"));
}

TEST_F(Commands, CompareRecordsFailuresAsFailures) {
  // Nothing moves: no reconstruction.
  const fs::path still = Path("still");
  fs::create_directory(still);
  for (int i = 0; i < 8; ++i) cv::imwrite(ImagePath(still, i), MovingFrame(0));
  const std::string compare = "compare " + still.string() +
                              " --trackers klt --backends ceres,colmap --quiet --out " +
                              Path("out") + " --colmap-program ";
  // What is missing is no tracker's failure.
  ExpectFailure(RunCohort(compare + Path("nocolmap")),
                1,
                AllOf(HasSubstr("nocolmap"), HasSubstr("leave colmap out of --backends")));
  EXPECT_FALSE(fs::exists(Path("out")));
  const ProgramEnd end = RunCohort(compare + "colmap");
  ASSERT_EQ(end.exit_code, 0) << end.err;
  EXPECT_THAT(end.out, HasSubstr("FAILED 0/8"));
  EXPECT_EQ(ReadJson(Path("out/results.json"))["failures"].size(), 2u);
  EXPECT_THAT(ReadBytes(Path("out/results.csv")),
              AllOf(HasSubstr("still,as-is,klt,ceres,1,failed,1,\n"),
                    HasSubstr("still,as-is,klt,ceres,1,halves_failed,1,\n"),
                    Not(HasSubstr("halves_disagreement")),
                    Not(HasSubstr("ate"))));
  // Where all is done nothing is missing.
  const auto resume = [&] {
    return test::RunShell("env PATH=/none " + ProgramPath() + " " + compare + "colmap --resume");
  };
  EXPECT_EQ(resume().exit_code, 0);
  fs::remove(Path("out/cells/still/as-is/1/klt/colmap.json"));
  ExpectFailure(resume(), 1, HasSubstr("colmap is not installed"));
  ExpectFailure(RunCohort("compare " + Path("none") + " --quiet --out " + Path("out")),
                1,
                HasSubstr(Path("none")));
  EXPECT_TRUE(fs::exists(Path("out/cells/still/as-is/1/klt/clip.tracks")));  // not lost by it
}

}  // namespace
}  // namespace cohort
