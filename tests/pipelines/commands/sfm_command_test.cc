// `cohort sfm`, as users run it, and what they open afterwards.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "backend/colmap/model_io.h"
#include "frontend/storage/output.h"
#include "tests/support/program.h"
#include "tests/support/source_dir.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

class Sfm : public testing::Test {
 protected:
  // A coloured clip of 24 small frames.
  static void SetUpTestSuite() {
    dir_ = new test::TempDir;
    const std::string clip = *dir_ / "rendered";
    ASSERT_EQ(test::RunCohort("synth " + clip +
                              " --scene facade --frames 24 --width-px 320 --height-px 240 "
                              "--focal-px 260 --quiet")
                  .exit_code,
              0);
    fs::create_directory(*dir_ / "clip");
    for (const auto& entry : fs::directory_iterator(fs::path(clip) / "rgb")) {
      const cv::Mat gray = cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE);
      cv::Mat colored;
      cv::applyColorMap(gray, colored, cv::COLORMAP_PINK);
      cv::imwrite((*dir_ / "clip" / entry.path().filename()).string(), colored);
    }
  }
  static void TearDownTestSuite() {
    delete dir_;
    dir_ = nullptr;
  }

  static test::ProgramEnd RunSfm(const std::string& scene,
                                 const std::string& more = "",
                                 const std::string& clip = *dir_ / "clip") {
    return test::RunCohort("sfm " + clip + " --camera 260,260,159.5,119.5,-0.1,0.02 " +
                           "--features 200 --quiet --out " + scene + " " + more);
  }
  static test::ProgramEnd Validate(const std::string& scene) {
    return test::RunShell("/usr/bin/python3 " + test::SourceDir().string() +
                          "/tests/pipelines/sfm/scene_validator.py " + scene);
  }
  static nlohmann::json Json(const fs::path& path) {
    return nlohmann::json::parse(ReadBytes(path));
  }

  static test::TempDir* dir_;
};
test::TempDir* Sfm::dir_ = nullptr;

// Pictures with a hole of alpha, and a mask for every other frame: the scene has both, under the
// names that COLMAP and Nerfstudio look for.
TEST_F(Sfm, MasksGoIntoTheScene) {
  fs::create_directory(*dir_ / "cut");
  fs::create_directory(*dir_ / "masks");
  int i = 0;
  for (const auto& entry : fs::directory_iterator(*dir_ / "clip")) {
    cv::Mat cut;
    cv::cvtColor(cv::imread(entry.path().string()), cut, cv::COLOR_BGR2BGRA);
    cut(cv::Rect(0, 0, 60, 240)).setTo(cv::Scalar(0, 0, 0, 0));
    const std::string name = entry.path().filename().string();
    cv::imwrite((*dir_ / "cut" / name).string(), cut);
    if (i++ % 2 == 0) continue;
    cv::Mat mask(240, 320, CV_8UC1, cv::Scalar(235));
    mask(cv::Rect(260, 0, 60, 240)).setTo(16);
    cv::imwrite((*dir_ / "masks" / (name + ".png")).string(), mask);
  }
  const fs::path scene = *dir_ / "masked";
  const std::string masks = "--mask " + (*dir_ / "masks").string();
  const test::ProgramEnd end = RunSfm(scene, masks, *dir_ / "cut");
  ASSERT_EQ(end.exit_code, 0) << end.err;
  EXPECT_THAT(end.err, HasSubstr("no mask of 12 of the 24 frames"));
  EXPECT_EQ(Validate(scene).exit_code, 0);
  int masked = 0;
  const nlohmann::json transforms = Json(scene / "transforms.json");
  for (const auto& frame : transforms.at("frames")) {
    const fs::path mask = scene / frame.at("mask_path").get<std::string>();
    EXPECT_EQ(mask.filename(), fs::path(frame.at("file_path")).filename().string() + ".png");
    const cv::Mat read = cv::imread(mask.string(), cv::IMREAD_UNCHANGED);
    ASSERT_EQ(read.size(), cv::Size(320, 240));
    EXPECT_EQ(read.at<std::uint8_t>(120, 40), 0);
    EXPECT_EQ(read.at<std::uint8_t>(120, 160), 255);
    if (read.at<std::uint8_t>(120, 280) == 0) ++masked;
  }
  EXPECT_GT(masked, 0);
  const std::string before = ReadBytes(scene / "summary.json");
  ASSERT_EQ(RunSfm(scene, masks + " --resume", *dir_ / "cut").exit_code, 0);
  EXPECT_EQ(ReadBytes(scene / "summary.json"), before);
  // A scene without masks does not keep those of another.
  ASSERT_EQ(RunSfm(scene).exit_code, 0);
  EXPECT_FALSE(fs::exists(scene / "masks"));
}

// Bars and a line of text: no point lies on them, the cameras are as right as without them, and the
// scene shows them as they are.
TEST_F(Sfm, BarsAndBurntInTextAreMaskedUnasked) {
  ASSERT_EQ(test::RunCohort("synth " + (*dir_ / "room").string() +
                            " --scene room --motion lateral --frames 48 --width-px 320 "
                            "--height-px 240 --focal-px 260 --quiet")
                .exit_code,
            0);
  fs::create_directory(*dir_ / "burnt-in");
  for (const auto& entry : fs::directory_iterator(*dir_ / "room" / "rgb")) {
    cv::Mat gray = cv::imread(entry.path().string(), cv::IMREAD_GRAYSCALE);
    for (const int top : {0, 215}) gray.rowRange(top, top + 25).setTo(0);
    cv::putText(gray, "21:14:09  43 km/h", {90, 205}, cv::FONT_HERSHEY_SIMPLEX, 0.5, 255, 2);
    cv::imwrite((*dir_ / "burnt-in" / entry.path().filename()).string(), gray);
  }
  const auto run = [&](const std::string& scene, const std::string& more) {
    return test::RunCohort("sfm " + (*dir_ / "burnt-in").string() +
                           " --camera 260,260,159.5,119.5 --features 200 --out " + scene + more);
  };
  const auto error_of = [&](const std::string& scene) {
    const std::string json = scene + ".json";
    EXPECT_EQ(test::RunCohort("evaluate " + scene + "/model --truth " + (*dir_ / "room").string() +
                              " --json " + json)
                  .exit_code,
              0);
    return Json(json).at("ate_share").get<double>();
  };
  const fs::path scene = *dir_ / "of-burnt-in";
  const test::ProgramEnd end = run(scene, "");
  ASSERT_EQ(end.exit_code, 0) << end.err;
  EXPECT_THAT(end.err, HasSubstr("of the picture area stays fixed while the rest moves"));
  EXPECT_LT(error_of(scene), 0.004);
  const cv::Mat picture = cv::imread((scene / "images/scene_000000.jpg").string(), 0);
  const cv::Mat mask = cv::imread((scene / "masks/scene_000000.jpg.png").string(), 0);
  ASSERT_EQ(picture.size(), mask.size());
  EXPECT_LT(cv::mean(picture, mask == 0)[0], 60.0) << "the bars are black in the scene";
  EXPECT_EQ(cv::countNonZero(mask.rowRange(0, 25)), 0);
  EXPECT_GT(cv::mean(mask.rowRange(60, 150))[0], 250.0);
  EXPECT_GT(cv::countNonZero(picture.rowRange(190, 206) > 240), 100) << "so is the text";

  const fs::path kept = *dir_ / "of-kept";
  EXPECT_THAT(run(kept, " --no-mask-fixed").err, Not(HasSubstr("stay as they are")));
  EXPECT_FALSE(fs::exists(kept / "masks"));
}

TEST_F(Sfm, MakesASceneThatOpens) {
  const fs::path scene = *dir_ / "scene";
  const test::ProgramEnd end = RunSfm(scene);
  ASSERT_EQ(end.exit_code, 0) << end.err;
  EXPECT_THAT(end.out, HasSubstr("24 of 24"));
  EXPECT_THAT(end.out, HasSubstr("% of the extent of their path"));
  const test::ProgramEnd valid = Validate(scene);
  EXPECT_EQ(valid.exit_code, 0) << valid.out << valid.err;
  // Of so short a way in the dark the cameras are uncertain, and that is all there is to say.
  const nlohmann::json summary = Json(scene / "summary.json");  // outlives the loop over its part
  for (const auto& reason : summary.at("reasons")) {
    EXPECT_EQ(reason.at("code"), "cameras-uncertain");
  }

  // What the stages are, by themselves.
  const std::string tracks = *dir_ / "alone.tracks";
  ASSERT_EQ(test::RunCohort(
                "track " + (*dir_ / "clip").string() +
                " --camera 260,260,159.5,119.5,-0.1,0.02 --features 200 --quiet --out " + tracks)
                .exit_code,
            0);
  EXPECT_EQ(ReadBytes(tracks), ReadBytes(scene / "clip.tracks"));
  ASSERT_EQ(test::RunCohort("reconstruct " + tracks +
                            " --backend ceres --ceres.covariances --quiet --out " +
                            (*dir_ / "alone").string())
                .exit_code,
            0);
  EXPECT_EQ(ReadBytes(*dir_ / "alone" / "images.bin"), ReadBytes(scene / "model" / "images.bin"));

  // Every kind of damage is seen.
  const auto damage = [&](const std::string& command) {
    fs::remove_all(*dir_ / "damaged");
    fs::copy(scene, *dir_ / "damaged", fs::copy_options::recursive);
    test::RunShell("cd " + (*dir_ / "damaged").string() + " && " + command);
    return Validate(*dir_ / "damaged").exit_code;
  };
  EXPECT_EQ(damage("true"), 0);
  EXPECT_EQ(damage("rm images/scene_000003.jpg; rm images/$(ls images | head -1)"), 1);
  EXPECT_EQ(damage("truncate -s -5 sparse/0/images.bin"), 1);
  EXPECT_EQ(damage("sed -i 's/\"fl_x\": [0-9.]*/\"fl_x\": 7/' transforms.json"), 1);
  EXPECT_EQ(damage("sed -i 's/images.scene_0000/images\\/scene_1000/' transforms.json"), 1);
  EXPECT_EQ(damage("truncate -s -15 sparse_pc.ply"), 1);
  EXPECT_EQ(damage("cp images/$(ls images | head -1) images/extra.jpg"), 1);
}

TEST_F(Sfm, BrightensPicturesAndColoursAlike) {
  const fs::path dark = *dir_ / "dark";
  fs::create_directory(dark);
  for (const auto& entry : fs::directory_iterator(*dir_ / "clip")) {
    cv::imwrite((dark / entry.path().filename()).string(), 0.3 * cv::imread(entry.path().string()));
  }
  const fs::path plain = *dir_ / "plain";
  const fs::path bright = *dir_ / "bright";
  ASSERT_EQ(RunSfm(plain, "--max-images 6", dark).exit_code, 0);
  ASSERT_EQ(RunSfm(bright, "--max-images 6 --brighten", dark).exit_code, 0);
  EXPECT_EQ(Validate(bright).exit_code, 0);
  const auto count = std::distance(fs::directory_iterator(bright / "images"), {});
  EXPECT_EQ(count, 6);
  const auto mean = [](const fs::path& scene) {
    double sum = 0.0;
    for (const auto& entry : fs::directory_iterator(scene / "images")) {
      const cv::Scalar m = cv::mean(cv::imread(entry.path().string()));
      sum += m[0] + m[1] + m[2];
    }
    return sum;
  };
  EXPECT_GT(mean(bright), 1.5 * mean(plain));
  const auto mean_of_points = [](const fs::path& scene) {
    double sum = 0.0;
    const ColmapModel model = ReadColmapModel(scene / "sparse/0");
    for (const auto& [id, point] : model.points) {
      sum += point.rgb[0] + point.rgb[1] + point.rgb[2];
    }
    return sum / static_cast<double>(model.points.size());
  };
  EXPECT_GT(mean_of_points(bright), 1.5 * mean_of_points(plain));
  // Nor does it matter that half of a picture and more is black, as around upright video.
  const fs::path bars = *dir_ / "bars";
  fs::create_directory(bars);
  for (const auto& entry : fs::directory_iterator(dark)) {
    cv::Mat picture = cv::imread(entry.path().string());
    cv::copyMakeBorder(
        picture, picture, 0, picture.rows, 0, picture.cols, cv::BORDER_CONSTANT, cv::Scalar());
    cv::imwrite((bars / entry.path().filename()).string(), picture);
  }
  const fs::path beside = *dir_ / "beside";
  ASSERT_EQ(RunSfm(beside, "--max-images 6 --brighten", bars).exit_code, 0);
  EXPECT_GT(mean(beside), 1.5 * mean(plain) / 4.0);
  // What is bright stays as it is.
  const fs::path day = *dir_ / "day";
  const fs::path same = *dir_ / "same";
  ASSERT_EQ(RunSfm(day, "--max-images 6").exit_code, 0);
  ASSERT_EQ(RunSfm(same, "--max-images 6 --brighten").exit_code, 0);
  EXPECT_EQ(mean(same), mean(day));
  EXPECT_EQ(ReadBytes(plain / "clip.tracks"), ReadBytes(bright / "clip.tracks"));
}

TEST_F(Sfm, GoesOnWhereItWasKilled) {
  const fs::path whole = *dir_ / "whole";
  ASSERT_EQ(RunSfm(whole).exit_code, 0);
  const fs::path killed = *dir_ / "killed";
  // Each time a little later, until it is done.
  int kills = 0;
  for (double seconds = 0.2; !fs::exists(killed / "summary.json") && kills < 40; seconds *= 1.3) {
    test::RunShell(
        "timeout -s KILL " + std::to_string(seconds) + " " + test::ProgramPath() + " sfm " +
        (*dir_ / "clip").string() +
        " --camera 260,260,159.5,119.5,-0.1,0.02 --features 200 --quiet --resume --out " +
        killed.string());
    ++kills;
  }
  EXPECT_GT(kills, 1);
  for (const char* file :
       {"clip.tracks", "model/images.bin", "sparse/0/points3D.bin", "transforms.json"}) {
    EXPECT_EQ(ReadBytes(killed / file), ReadBytes(whole / file)) << file;
  }
  const auto written = fs::last_write_time(killed / "transforms.json");
  ASSERT_EQ(RunSfm(killed, "--resume").exit_code, 0);
  EXPECT_EQ(fs::last_write_time(killed / "transforms.json"), written) << "it was done";
  ASSERT_EQ(RunSfm(killed, "--resume --max-images 5").exit_code, 0);
  EXPECT_NE(fs::last_write_time(killed / "transforms.json"), written) << "it is another scene";
}

TEST_F(Sfm, KeepsWhatIsBeforeTheOptionsThatChanged) {
  const fs::path scene = *dir_ / "kept";
  ASSERT_EQ(RunSfm(scene).exit_code, 0);
  const auto written = [&](const char* name) { return fs::last_write_time(scene / name); };
  const auto tracks = written("clip.tracks");
  const auto model = written("model/images.bin");

  ASSERT_EQ(RunSfm(scene, "--resume --max-images 5").exit_code, 0);
  EXPECT_EQ(written("clip.tracks"), tracks);
  EXPECT_EQ(written("model/images.bin"), model) << "only the scene's options changed";
  EXPECT_EQ(Json(scene / "transforms.json").at("frames").size(), 5u);
  EXPECT_EQ(Validate(scene).exit_code, 0);
  const fs::path anew = *dir_ / "anew";
  ASSERT_EQ(RunSfm(anew, "--max-images 5").exit_code, 0);
  for (const char* file : {"transforms.json", "sparse/0/points3D.bin", "sparse_pc.ply"}) {
    EXPECT_EQ(ReadBytes(scene / file), ReadBytes(anew / file)) << file;
  }

  ASSERT_EQ(RunSfm(scene, "--resume --brighten").exit_code, 0);
  EXPECT_EQ(written("model/images.bin"), model);

  ASSERT_EQ(RunSfm(scene, "--resume --model.ceres.min-track-length 5").exit_code, 0);
  EXPECT_EQ(written("clip.tracks"), tracks);
  EXPECT_NE(written("model/images.bin"), model) << "the model's options changed";

  // Of the first stage: tracks take the time, so they are not lost by a slip of the hand.
  const test::ProgramEnd other = RunSfm(scene, "--resume --track.detector.max-features 90");
  EXPECT_EQ(other.exit_code, 1);
  EXPECT_THAT(other.err, HasSubstr("cannot resume"));
  EXPECT_EQ(written("clip.tracks"), tracks);
  EXPECT_TRUE(fs::exists(scene / "summary.json")) << "the scene is still whole";
}

TEST_F(Sfm, MakesAnewWhatIsGoneOrDamaged) {
  const fs::path whole = *dir_ / "undamaged";
  ASSERT_EQ(RunSfm(whole, "--max-images 5").exit_code, 0);
  // Its summary is no model's: the page would have had figures and no model.
  const test::ProgramEnd shown = test::RunCohort(
      fmt::format("show {0}/clip.tracks --model {0} --out {0}.html", whole.string()));
  EXPECT_EQ(shown.exit_code, 1);
  EXPECT_THAT(shown.err, HasSubstr((whole / "model").string()));
  const fs::path scene = *dir_ / "mended";
  fs::copy(whole, scene, fs::copy_options::recursive);
  for (const char* damage : {"rm -r images sparse transforms.json",
                             "rm images/$(ls images | head -1)",
                             "truncate -s 10 images/$(ls images | tail -1)",
                             "rm sparse/0/points3D.bin",
                             "rm model/images.txt",
                             "truncate -s 100 model/points3D.bin",
                             "rm clip.tracks",
                             "rm model/points3D.bin summary.json",
                             "echo nonsense > model_of.json"}) {
    SCOPED_TRACE(damage);
    test::RunShell("cd " + scene.string() + " && " + damage);
    const test::ProgramEnd end = RunSfm(scene, "--resume --max-images 5");
    EXPECT_EQ(end.exit_code, 0) << end.err;
    for (const auto& entry : fs::recursive_directory_iterator(whole)) {
      const fs::path file = entry.path().lexically_relative(whole);
      if (!entry.is_regular_file() || file == "model/summary.json") continue;  // has a time in it
      EXPECT_TRUE(ReadBytes(scene / file) == ReadBytes(whole / file)) << file;
    }
  }

  // Tracks take the time, and half of them may be of use: so they are not made anew unasked.
  test::RunShell("truncate -s 5000 " + (scene / "clip.tracks").string());
  const test::ProgramEnd cut = RunSfm(scene, "--resume --max-images 5");
  EXPECT_EQ(cut.exit_code, 1);
  EXPECT_THAT(cut.err, HasSubstr("clip.tracks"));
}

// Pictures without compression: as large whatever they show.
TEST_F(Sfm, KnowsAnotherClipOfEqualSizeAndACopyOfTheSame) {
  const fs::path clip = *dir_ / "bitmaps";
  fs::create_directory(clip);
  const auto write = [&](bool mirrored) {
    for (const auto& entry : fs::directory_iterator(*dir_ / "clip")) {
      cv::Mat picture = cv::imread(entry.path().string());
      if (mirrored) cv::flip(picture, picture, 1);
      cv::imwrite((clip / entry.path().stem()).string() + ".bmp", picture);
    }
  };
  const std::string command = "sfm " + clip.string() +
                              " --camera 260,260,159.5,119.5 --features 100 --quiet --resume "
                              "--second-pass off --out " +
                              (*dir_ / "bitmap_scene").string();
  write(false);
  ASSERT_EQ(test::RunCohort(command).exit_code, 0);
  const auto written = fs::last_write_time(*dir_ / "bitmap_scene" / "transforms.json");
  write(false);  // the same bytes, another time
  ASSERT_EQ(test::RunCohort(command).exit_code, 0);
  EXPECT_EQ(fs::last_write_time(*dir_ / "bitmap_scene" / "transforms.json"), written);
  write(true);
  const test::ProgramEnd end = test::RunCohort(command);
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_THAT(end.err, HasSubstr("was made from another input"));
}

TEST_F(Sfm, ThatHasNoModelSaysWhatToDo) {
  fs::create_directory(*dir_ / "black");
  for (int i = 0; i < 5; ++i) {
    cv::imwrite((*dir_ / "black" / (std::to_string(i) + ".png")).string(),
                cv::Mat::zeros(120, 160, CV_8UC1));
  }
  const fs::path scene = *dir_ / "no_scene";
  const test::ProgramEnd end =
      test::RunCohort("sfm " + (*dir_ / "black").string() + " --quiet --out " + scene.string());
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_THAT(end.err, HasSubstr("cohort: error: the reconstruction failed: 0 of 5"));
  EXPECT_TRUE(Json(scene / "summary.json").at("failed"));
  EXPECT_THAT(end.out, HasSubstr("To film better: Hardly any points can be tracked"));
  EXPECT_THAT(end.out, HasSubstr("The pictures are dark, 0 of 255"));
  EXPECT_THAT(ReadBytes(scene / "report.html"), HasSubstr("Hardly any points can be tracked"));
}

// Pieces of one picture: what a camera sees that stands still or turns before things far away.
TEST_F(Sfm, OfACameraThatStandsOrTurnsSaysSo) {
  cv::Mat wall(400, 600, CV_8UC1);
  cv::RNG random(7);
  random.fill(wall, cv::RNG::UNIFORM, 0, 255);
  cv::GaussianBlur(wall, wall, {}, 3.0);
  cv::normalize(wall, wall, 0, 255, cv::NORM_MINMAX);
  const auto film = [&](const std::string& name, double yaw) {
    fs::create_directory(*dir_ / name);
    for (int i = 0; i < 16; ++i) {
      // What 260 px of focal length see after a turn, in the wall's pixels.
      const double angle = yaw * i;
      const cv::Matx33d k(260, 0, 160, 0, 260, 120, 0, 0, 1);
      const cv::Matx33d turn(
          std::cos(angle), 0, std::sin(angle), 0, 1, 0, -std::sin(angle), 0, std::cos(angle));
      const cv::Matx33d shift(1, 0, 140, 0, 1, 80, 0, 0, 1);
      cv::Mat picture;
      cv::warpPerspective(wall,
                          picture,
                          shift * k * turn * k.inv(),
                          {320, 240},
                          cv::INTER_LINEAR | cv::WARP_INVERSE_MAP);
      cv::imwrite((*dir_ / name / (std::to_string(100 + i) + ".png")).string(), picture);
    }
    const test::ProgramEnd end =
        test::RunCohort("sfm " + (*dir_ / name).string() + " --features 150 --quiet --out " +
                        (*dir_ / (name + "_scene")).string());
    EXPECT_EQ(end.exit_code, 1);
    EXPECT_THAT(end.err, HasSubstr("0 of 16 frames have a pose"));
    return end.out;
  };
  EXPECT_THAT(film("stands", 0.0), HasSubstr("To film better: The camera stood still"));
  EXPECT_THAT(film("turns", 0.01), HasSubstr("To film better: The camera only turned"));
}

// A toy castle that is turned before a room that stays, and the castle alone.
TEST_F(Sfm, SaysThatSomethingMoves) {
  const std::string castle = "/usr/share/visp-images-data/ViSP-images/mbt-depth/castel/castel";
  if (!fs::exists(castle)) GTEST_SKIP() << "needs Debian's visp-images-data";
  const std::string command = "sfm " + castle +
                              " --camera 615.167,615.168,312.189,243.437 --features 200 "
                              "--second-pass off --quiet --out ";
  const test::ProgramEnd both = test::RunCohort(command + (*dir_ / "both").string());
  ASSERT_EQ(both.exit_code, 0) << both.err;
  EXPECT_THAT(both.out, HasSubstr("To film better: Something moves in the picture"));
  const test::ProgramEnd one =
      test::RunCohort(command + (*dir_ / "one").string() + " --mask " +
                      (test::SourceDir() / "tests/benchmark/castle_mask.png").string());
  ASSERT_EQ(one.exit_code, 0) << one.err;
  EXPECT_THAT(one.out, Not(HasSubstr("Something moves")));
}

TEST_F(Sfm, ReplacesASceneOfOtherFramesWhole) {
  const fs::path scene = *dir_ / "again";
  ASSERT_EQ(RunSfm(scene).exit_code, 0);
  ASSERT_EQ(RunSfm(scene, "--frames :16").exit_code, 0);
  const test::ProgramEnd valid = Validate(scene);
  EXPECT_EQ(valid.exit_code, 0) << valid.out << valid.err;
  EXPECT_EQ(Json(scene / "summary.json").at("frames"), 16);

  // Without a model nothing of the old scene stays.
  EXPECT_EQ(RunSfm(scene, "--frames :1").exit_code, 1);
  for (const char* name : {"images", "sparse", "transforms.json", "sparse_pc.ply"}) {
    EXPECT_FALSE(fs::exists(scene / name)) << name;
  }
}

TEST_F(Sfm, ReplacesNothingThatIsNotItsOwn) {
  const fs::path scene = *dir_ / "others";
  fs::create_directories(scene / "images");
  WriteBytes(scene / "images" / "holiday.jpg", "not ours");
  const test::ProgramEnd end = RunSfm(scene);
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_THAT(end.err, HasSubstr("holiday.jpg"));
  EXPECT_EQ(ReadBytes(scene / "images" / "holiday.jpg"), "not ours");
  EXPECT_FALSE(fs::exists(scene / "clip.tracks")) << "it says so before the work";
}

TEST_F(Sfm, APageAndASummaryOfOthersAreLeftAlone) {
  for (const char* name : {"report.html", "summary.json"}) {
    const test::TempDir project;
    WriteBytes(project / name, "precious");
    const test::ProgramEnd end = RunSfm(project.path());
    EXPECT_EQ(end.exit_code, 1);
    EXPECT_THAT(end.err, HasSubstr(name));
    EXPECT_EQ(ReadBytes(project / name), "precious");
    EXPECT_FALSE(fs::exists(project / "clip.tracks")) << "it says so before the work";
  }
}

// COLMAP's and Nerfstudio's projects have folders of the same names.
TEST_F(Sfm, AProjectOfOthersIsLeftAlone) {
  const test::TempDir project;
  fs::create_directories(project / "images");
  for (const auto& entry : fs::directory_iterator(*dir_ / "clip")) {
    const cv::Mat picture = cv::imread(entry.path().string());
    cv::imwrite((project / "images" / entry.path().stem()).string() + ".jpg", picture);
  }
  for (const bool with_model : {false, true}) {
    if (with_model) {
      fs::remove_all(project / "images");
      fs::create_directories(project / "sparse/0");
      WriteBytes(project / "sparse/0/cameras.bin", "precious");
    }
    const std::string input =
        with_model ? (*dir_ / "clip").string() : (project / "images").string();
    const test::ProgramEnd end =
        test::RunCohort("sfm " + input + " --features 60 --out " + project.path().string());
    EXPECT_EQ(end.exit_code, 1);
    EXPECT_THAT(
        end.err,
        HasSubstr(with_model ? "which does not belong to a scene of cohort" : "this run reads"));
    EXPECT_THAT(end.err, HasSubstr("give another folder"));
    EXPECT_FALSE(fs::exists(project / "clip.tracks"));
  }
  EXPECT_EQ(ReadBytes(project / "sparse/0/cameras.bin"), "precious");
}

}  // namespace
}  // namespace cohort
