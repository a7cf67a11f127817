// `cohort show`: the video is decoded again, the page is opened and used in a real browser.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "datasets/open_sequence.h"
#include "frontend/core/error.h"
#include "frontend/storage/output.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/report/clip_report.h"
#include "tests/support/browser.h"
#include "tests/support/program.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class Show : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    dir_ = new test::TempDir;
    // A name that would be active content, if it were let.
    clip_ = (*dir_ / "<img src=x onerror=alert(1)>").string();
    Run("synth '" + clip_ + "' --frames 20 --width-px 320 --height-px 240 --focal-px 260 --quiet");
    Run("track '" + clip_ + "' --features 150 --quiet --out " + Path("a.tracks"));
    Run("track '" + clip_ + "' --features 80 --tracker klt --quiet --out " + Path("b.tracks"));
    Run("reconstruct " + Path("a.tracks") + " --backend ceres --ceres.covariances --quiet --out " +
        Path("model"));
  }
  static void TearDownTestSuite() {
    delete dir_;
    dir_ = nullptr;
  }

  static void Run(const std::string& arguments) {
    const test::ProgramEnd end = test::RunCohort(arguments);
    ASSERT_EQ(end.exit_code, 0) << arguments << "\n" << end.err;
  }
  static std::string Path(const std::string& name) { return (*dir_ / name).string(); }

  static test::TempDir* dir_;
  static std::string clip_;
};
test::TempDir* Show::dir_ = nullptr;
std::string Show::clip_;

TEST_F(Show, WritesAVideoInWhichEveryTrackIsWhereItIs) {
  Run("show " + Path("a.tracks") + " " + Path("b.tracks") + " --quiet --out " + Path("v.mp4"));
  const TrackFile file = ReadTrackFile(Path("a.tracks"));
  cv::VideoCapture video(Path("v.mp4"));
  ASSERT_TRUE(video.isOpened());
  constexpr int kCaption = 44;
  cv::Mat picture;
  int frames = 0;
  int observed = 0;
  int coloured = 0;
  for (; video.read(picture); ++frames) {
    ASSERT_EQ(picture.size(), cv::Size(640, 240 + kCaption));
    for (const Observation* o : file.tracks.InFrame(FrameIndex(frames))) {
      if (!IsObserved(*o)) continue;
      const cv::Point at(static_cast<int>(std::lround(o->xy.x())),
                         kCaption + static_cast<int>(std::lround(o->xy.y())));
      if (!cv::Rect(2, 0, 316, picture.rows).contains(at)) continue;
      const auto& pixel = picture.at<cv::Vec3b>(at);  // blue, green, red
      ++observed;
      if (pixel[0] > pixel[2] + 60) ++coloured;
    }
  }
  EXPECT_EQ(frames, 20);
  ASSERT_GT(observed, 1000);
  EXPECT_GT(coloured, 0.95 * observed);
}

TEST_F(Show, WritesAGif) {
  Run("show " + Path("a.tracks") + " --width-px 160 --quiet --out " + Path("v.gif"));
  EXPECT_EQ(ReadBytes(Path("v.gif")).substr(0, 6), "GIF89a");
  cv::VideoCapture video(Path("v.gif"));
  EXPECT_EQ(video.get(cv::CAP_PROP_FRAME_WIDTH), 160);
}

TEST_F(Show, AGifThatFfmpegDidNotWriteIsAnError) {
  fs::create_directory(Path("bin"));
  WriteBytes(Path("bin/ffmpeg"), "#!/bin/sh\nexit 0\n");
  fs::permissions(Path("bin/ffmpeg"), fs::perms::owner_all);
  WriteBytes(Path("kept.gif"), "old");
  const std::string path = std::getenv("PATH");
  ASSERT_EQ(setenv("PATH", (Path("bin") + ":" + path).c_str(), 1), 0);
  const test::ProgramEnd end = test::RunCohort("show " + Path("a.tracks") +
                                               " --width-px 160 --quiet --out " + Path("kept.gif"));
  ASSERT_EQ(setenv("PATH", path.c_str(), 1), 0);
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_THAT(end.err, HasSubstr("kept.gif"));
  EXPECT_EQ(ReadBytes(Path("kept.gif")), "old");
}

TEST_F(Show, OfClipsThatAreNotOneSaysSoAndLeavesNothing) {
  Run("synth " + Path("other") +
      " --frames 6 --width-px 160 --height-px 120 --focal-px 130 --quiet");
  Run("track " + Path("other") + " --features 30 --second-pass off --quiet --out " +
      Path("c.tracks"));
  const test::ProgramEnd end = test::RunCohort("show " + Path("a.tracks") + " " + Path("c.tracks") +
                                               " --quiet --out " + Path("never.mp4"));
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_THAT(end.err, HasSubstr("320x240 and 160x120"));
  EXPECT_FALSE(fs::exists(Path("never.mp4")));
}

TEST_F(Show, OfPicturesOfAnotherSizeSaysSoAndLeavesNothing) {
  Run("synth " + Path("small") +
      " --frames 6 --width-px 160 --height-px 120 --focal-px 130 --quiet");
  for (const char* name : {"never.html", "never.mp4"}) {
    const test::ProgramEnd end = test::RunCohort("show " + Path("a.tracks") + " --images " +
                                                 Path("small") + " --quiet --out " + Path(name));
    EXPECT_EQ(end.exit_code, 1) << name;
    EXPECT_THAT(
        end.err,
        HasSubstr("the pictures of small are 160x120, but the tracks were made from 320x240"));
    EXPECT_FALSE(fs::exists(Path(name)));
  }
}

TEST_F(Show, ShowsPicturesOfAnyShape) {
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(1000, 1), cv::Size(1, 1000)}) {
    const std::string clip = Path(fmt::format("{}x{}", size.width, size.height));
    fs::create_directory(clip);
    for (const char* name : {"/0.png", "/1.png", "/2.png"}) {
      cv::imwrite(clip + name, cv::Mat(size, CV_8UC1, cv::Scalar(100)));
    }
    Run(fmt::format("track {0} --second-pass off --quiet --out {0}.tracks", clip));
    for (const char* ending : {"html", "mp4"}) {
      Run(fmt::format("show {0}.tracks --quiet --out {0}.{1}", clip, ending));
    }
  }
  // JPEG has sides of 65,500 px at most; a page's pictures are small.
  fs::create_directory(Path("tall"));
  for (const char* name : {"/0.png", "/1.png", "/2.png"}) {
    cv::imwrite(Path("tall") + name, cv::Mat(70'000, 20, CV_8UC1, cv::Scalar(100)));
  }
  Run("track " + Path("tall") + " --second-pass off --quiet --out " + Path("tall.tracks"));
  Run("show " + Path("tall.tracks") + " --quiet --out " + Path("tall.html"));
  const test::ProgramEnd end =
      test::RunCohort("show " + Path("tall.tracks") + " --quiet --out " + Path("tall.mp4"));
  EXPECT_THAT(end.err, AllOf(HasSubstr("20x70044"), HasSubstr("--width-px")));
  Run("show " + Path("tall.tracks") + " --quiet --width-px 2 --out " + Path("tall.mp4"));
}

TEST_F(Show, NamesTheKindsOfFilesThatItWrites) {
  const test::ProgramEnd end =
      test::RunCohort("show " + Path("a.tracks") + " --quiet --out " + Path("v.xyz"));
  EXPECT_EQ(end.exit_code, 2);
  EXPECT_THAT(end.err,
              AllOf(HasSubstr("v.xyz"), HasSubstr(".mp4"), HasSubstr(".gif"), HasSubstr(".html")));
}

TEST_F(Show, TellsClipsOfOneSizeApart) {
  Run("synth " + Path("second") +
      " --seed 2 --frames 20 --width-px 320 --height-px 240 --focal-px 260 --quiet");
  Run("track " + Path("second") + " --tracker klt --features 30 --quiet --out " +
      Path("second.tracks"));
  const std::string both = "show " + Path("a.tracks") + " " + Path("second.tracks") + " --quiet ";
  const test::ProgramEnd end = test::RunCohort(both + "--out " + Path("never.mp4"));
  EXPECT_EQ(end.exit_code, 1);
  EXPECT_THAT(end.err,
              AllOf(HasSubstr("a.tracks was made from "), HasSubstr("second.tracks from ")));
  EXPECT_EQ(std::count(end.err.begin(), end.err.end(), '\n'), 1) << end.err;
  EXPECT_FALSE(fs::exists(Path("never.mp4")));
  // Who says which clip to show knows: such as one clip in daylight and in the dark.
  Run(both + "--images " + Path("second") + " --out " + Path("said.mp4"));

  // The same clip under another name is the same clip.
  fs::copy(clip_, Path("copy"), fs::copy_options::recursive);
  Run("track " + Path("copy") + " --tracker klt --features 30 --quiet --out " +
      Path("copy.tracks"));
  Run("show " + Path("a.tracks") + " " + Path("copy.tracks") + " --quiet --out " + Path("c.mp4"));

  // And another one under the same name is not.
  fs::remove_all(Path("copy"));
  fs::rename(Path("second"), Path("copy"));
  const test::ProgramEnd changed =
      test::RunCohort("show " + Path("copy.tracks") + " --quiet --out " + Path("d.mp4"));
  EXPECT_EQ(changed.exit_code, 0) << changed.err;
  EXPECT_THAT(changed.err, HasSubstr("has changed since"));
}

// A static picture in the dark, for which any track will do.
class ShowLight : public testing::Test {
 protected:
  // The mean of the film's frames where the blinking lamp is not.
  std::vector<double> Film(const std::vector<double>& light, bool lamp) {
    fs::remove_all(dir_ / "clip");
    fs::create_directory(dir_ / "clip");
    cv::Mat picture(120, 160, CV_8UC1);
    cv::RNG random(1);
    random.fill(picture, cv::RNG::UNIFORM, 20, 200);
    cv::GaussianBlur(picture, picture, {}, 2.0);
    std::string csv = "track_id,frame,x,y\n";
    for (std::size_t i = 0; i < light.size(); ++i) {
      cv::Mat frame = picture * light[i];
      if (lamp && i % 2 == 1) frame(cv::Rect(0, 0, 20, 20)) = cv::Scalar(250);
      cv::imwrite(dir_ / fmt::format("clip/{:03}.png", i), frame);
      csv += fmt::format("0,{},80,60\n", i);
    }
    WriteBytes(dir_ / "t.csv", csv);
    for (const std::string& command :
         {"import " + (dir_ / "t.csv").string() + " --images " + (dir_ / "clip").string() +
              " --quiet --out " + (dir_ / "t.tracks").string(),
          "show " + (dir_ / "t.tracks").string() + " --quiet --out " + (dir_ / "t.mp4").string()}) {
      const test::ProgramEnd end = test::RunCohort(command);
      EXPECT_EQ(end.exit_code, 0) << end.err;
    }
    cv::VideoCapture video(dir_ / "t.mp4");
    std::vector<double> means;
    cv::Mat shown;
    while (video.read(shown)) means.push_back(cv::mean(shown(cv::Rect(40, 80, 110, 80)))[0]);
    return means;
  }

  test::TempDir dir_;
};

TEST_F(ShowLight, ALampThatBlinksMakesNoPictureFlicker) {
  const std::vector<double> means = Film(std::vector<double>(40, 0.1), true);
  ASSERT_EQ(means.size(), 40u);
  for (std::size_t i = 1; i < means.size(); ++i) {
    EXPECT_NEAR(means[i], means[i - 1], 0.1 * means[i]) << "frame " << i;
  }
}

TEST_F(ShowLight, ADarkClipIsVisibleAndSoIsOneThatGrowsLight) {
  for (const double mean : Film(std::vector<double>(10, 0.04), false)) EXPECT_GT(mean, 50.0);
  std::vector<double> light;
  for (int i = 0; i < 120; ++i) light.push_back(0.05 * std::pow(16.0, i / 120.0));
  const std::vector<double> means = Film(light, false);
  for (std::size_t i = 0; i < means.size(); ++i) {
    EXPECT_GT(means[i], 30.0) << "frame " << i;
    EXPECT_LT(means[i], 180.0) << "frame " << i;
  }
}

// Uses every control and says what it did.
constexpr const char* kUse = R"(<script nonce="probe">
window.complaints = [];
addEventListener('error', (event) => complaints.push(String(event.message)));
addEventListener('securitypolicyviolation', (event) => complaints.push(event.violatedDirective + ' ' + event.blockedURI));
for (const kind of ['error', 'warn']) console[kind] = (...what) => complaints.push(what.join(' '));
addEventListener('load', () => setTimeout(async () => {
  const wait = (ms) => new Promise((resolve) => setTimeout(resolve, ms));
  const get = (id) => document.getElementById(id);
  const look = (canvas) => canvas.toDataURL();
  const view = () => look(document.querySelector('#view canvas'));
  const player = () => look(get('player'));
  const changes = {};
  const change = async (name, see, act) => {
    const before = see();
    act();
    await wait(150);
    changes[name] = before !== see();
  };
  const toggle = (id) => () => get(id).click();
  const marks = () => [...document.querySelectorAll('.mark')].map((mark) => mark.style.left).join();
  const press = (plot) => () => {
    const over = plot.querySelector('.u-over');
    const area = over.getBoundingClientRect();
    for (const kind of ['mouseenter', 'mousemove', 'click']) {
      over.dispatchEvent(new MouseEvent(kind, {bubbles: true, clientX: area.left + 0.75 * area.width, clientY: area.top + 20}));
    }
  };
  await wait(300);
  await change('slider', player, () => { get('slider').value = 12; get('slider').dispatchEvent(new Event('input')); });
  await change('slider marks the camera', view, () => { get('slider').value = 3; get('slider').dispatchEvent(new Event('input')); });
  await change('slider marks the plots', marks, () => { get('slider').value = 4; get('slider').dispatchEvent(new Event('input')); });
  const apart = new Set(marks().split(',').map(parseFloat)).size;
  for (const plot of document.querySelectorAll('.plot')) {
    await change(`plot ${plot.id}`, () => get('frame').textContent, press(plot));
    get('slider').value = 3;
    get('slider').dispatchEvent(new Event('input'));
  }
  const frame = get('frame').textContent;
  for (const id of ['observed', 'tails']) await change(id, player, toggle(id));
  get('observed').click();
  get('tails').click();
  await change('play', () => get('frame').textContent, toggle('play'));
  await change('pause', () => get('play').textContent, toggle('play'));
  for (const id of ['points', 'cameras', 'uncertainty']) await change(id, view, toggle(id));
  for (const id of ['points', 'cameras', 'uncertainty']) get(id).click();
  const start = view();
  await change('wheel', view, () => document.querySelector('#view canvas').dispatchEvent(
    new WheelEvent('wheel', {deltaY: 400, bubbles: true, cancelable: true})));
  get('reset').click();
  await wait(150);
  const reset = view() === start;
  await change('theme', () => getComputedStyle(document.body).backgroundColor, toggle('theme'));
  const out = document.createElement('pre');
  out.id = 'probe';
  out.textContent = JSON.stringify({
    complaints, changes, reset, frame, apart,
    plots: [...document.querySelectorAll('.plot')].map((plot) => plot.id),
    said: [get('thinned').textContent, get('note').textContent],
    shown: Number(get('slider').max) + 1,
    bare: JSON.parse(get('data').textContent).frames.filter((frame) => !frame.positions.length).length,
    tall: document.documentElement.scrollHeight,
    ready: document.body.dataset.ready || null,
    title: document.querySelector('h1').textContent,
    pictures: document.images.length,
    fetched: performance.getEntriesByType('resource').map((r) => r.name.slice(0, 80)).filter((name) => !name.startsWith('data:')),
    wider: document.documentElement.scrollWidth - innerWidth,
  });
  top.document.body.append(out);
}, 300));
</script>)";

nlohmann::json Use(const std::string& page, int width_px) {
  std::string html = test::WithProbes(ReadBytes(page));
  html.insert(html.find("<style>"), kUse);
  html = test::Framed(html, width_px, 900);
  const std::string copy = page + ".used.html";
  WriteBytes(copy, html);
  const test::ProgramEnd end =
      test::Browse(copy, "--window-size=1200,900 --dump-dom", fs::path(page).parent_path());
  const auto probe = test::Probe(end.out);
  if (!probe)
    throw std::runtime_error("the page did not come to its end: " + end.err.substr(0, 500));
  return nlohmann::json::parse(*probe);
}

TEST_F(Show, MakesAPageOfWhichEveryControlDoesSomething) {
  if (test::Browser().empty()) GTEST_SKIP() << "no chromium";
  Run("show " + Path("a.tracks") + " --model " + Path("model") + " --quiet --out " +
      Path("page.html"));
  const nlohmann::json used = Use(Path("page.html"), 1200);
  EXPECT_EQ(used.at("ready"), "yes");
  EXPECT_THAT(used.at("complaints"), IsEmpty()) << used.dump();
  EXPECT_THAT(used.at("fetched"), IsEmpty()) << "the page opens offline";
  EXPECT_EQ(used.at("title"), "<img src=x onerror=alert(1)>") << "names are text";
  EXPECT_TRUE(used.at("reset")) << "the view is where it was at first";
  EXPECT_THAT(used.at("frame").get<std::string>(), HasSubstr("frame 3: "));
  for (const auto& [control, changed] : used.at("changes").items()) EXPECT_TRUE(changed) << control;
  EXPECT_EQ(used.at("changes").size(), 16u);
  EXPECT_EQ(used.at("plots"), nlohmann::json({"features", "motion", "way", "residual"}));
  EXPECT_EQ(used.at("apart"), 1) << "all plots mark the same frame";
  EXPECT_LE(used.at("wider"), 0);
  EXPECT_EQ(used.at("shown"), 20);
  EXPECT_THAT(used.at("said").dump(), AllOf(Not(HasSubstr("frames")), HasSubstr("points")))
      << "nothing was left out";
}

TEST_F(Show, MakesAPageThatFitsAPhone) {
  if (test::Browser().empty()) GTEST_SKIP() << "no chromium";
  Run("show " + Path("a.tracks") + " --model " + Path("model") + " --quiet --out " +
      Path("phone.html"));
  for (const int width_px : {360, 500}) {
    const nlohmann::json used = Use(Path("phone.html"), width_px);
    EXPECT_LE(used.at("wider"), 0) << width_px;
    EXPECT_THAT(used.at("complaints"), IsEmpty()) << used.dump();
    for (const auto& [control, changed] : used.at("changes").items()) {
      EXPECT_TRUE(changed) << control << " at " << width_px;
    }
  }
}

// Of what becomes of texts that are markup wherever somebody forgets that they are text, and of
// scripts and pictures that got into the page in spite of that.
constexpr const char* kAttack = R"js(<script nonce="probe">
window.alerts = [];
window.alert = (what) => alerts.push(String(what));
window.violations = [];
addEventListener('securitypolicyviolation', (event) => violations.push(event.effectiveDirective));
addEventListener('load', () => setTimeout(() => {
  const markup = [...document.querySelectorAll('script, img, iframe, object, embed, link')]
      .map((element) => element.outerHTML.slice(0, 60));
  const inject = document.createElement('div');
  inject.innerHTML = '<img src="x" onerror="alert(2)"><img src="http://127.0.0.1:9/a.png">' +
      '<iframe src="javascript:parent.alert(3)"></iframe><a id="js" href="javascript:alert(4)">a</a>';
  document.body.append(inject);
  document.getElementById('js').click();
  const script = document.createElement('script');
  script.textContent = 'alert(5)';
  document.body.append(script);
  fetch('http://127.0.0.1:9/').catch(() => {});
  setTimeout(() => {
    const out = document.createElement('pre');
    out.id = 'probe';
    out.textContent = JSON.stringify({alerts, violations, markup, text: document.body.innerText,
        ready: document.body.dataset.ready || null});
    document.body.append(out);
  }, 500);
}, 500));
</script>)js";

TEST_F(Show, NoNameAndNoTextOfAFileBecomesActive) {
  if (test::Browser().empty()) GTEST_SKIP() << "no chromium";
  const std::string attack = "</script><script>alert(1)</script><img src=x onerror=alert(1)>";
  TrackFile file = ReadTrackFile(Path("a.tracks"));
  for (FrameInfo& frame : file.frames) frame.name = "\"onerror=alert(1) " + attack + frame.name;
  file.meta.tracker = attack;
  WriteTrackFile(Path("attack.tracks"), file);
  fs::copy(Path("model"), Path("attack_model"));
  nlohmann::json summary = nlohmann::json::parse(ReadBytes(Path("model/summary.json")));
  summary["quality"] = attack;
  summary["reasons"] = {
      {{"code", attack}, {"sentence", attack}, {"figures", nlohmann::json::object()}},
      {{"code", "parts"},
       {"sentence", "<iframe src=javascript:alert(1)>"},
       {"figures", nlohmann::json::object()}}};
  WriteBytes(dir_->path() / "attack_model" / "summary.json", summary.dump());
  Run("show " + Path("attack.tracks") + " --images '" + clip_ + "' --model " +
      Path("attack_model") + " --quiet --out " + Path("attack.html"));

  std::string html = test::WithProbes(ReadBytes(Path("attack.html")));
  html.insert(html.find("<style>"), kAttack);
  html.insert(html.find("</body>"), "<script>alert(6)</script>");
  WriteBytes(Path("attacked.html"), html);
  const test::ProgramEnd end = test::Browse(Path("attacked.html"), "--dump-dom", dir_->path());
  const auto probe = test::Probe(end.out);
  ASSERT_TRUE(probe.has_value()) << end.err.substr(0, 500);
  const nlohmann::json seen = nlohmann::json::parse(*probe);
  EXPECT_EQ(seen.at("ready"), "yes");
  EXPECT_THAT(seen.at("alerts"), IsEmpty());
  EXPECT_THAT(seen.at("text").get<std::string>(), HasSubstr(attack)) << "it is text";
  EXPECT_EQ(seen.at("markup").size(), 5u) << "the probe, the data, the page, the icon and ours\n"
                                          << seen.at("markup").dump();
  const auto violations = seen.at("violations").get<std::multiset<std::string>>();
  EXPECT_GE(violations.count("img-src"), 2u) << seen.dump();
  EXPECT_GE(violations.count("script-src-elem"), 2u);
  EXPECT_GE(violations.count("script-src-attr"), 1u);
  EXPECT_EQ(violations.count("connect-src"), 1u);
}

TEST_F(Show, MakesAPageWithoutAModelToo) {
  if (test::Browser().empty()) GTEST_SKIP() << "no chromium";
  Run("show " + Path("b.tracks") + " --quiet --out " + Path("tracks.html"));
  const test::ProgramEnd end = test::Browse(Path("tracks.html"), "--dump-dom", dir_->path());
  EXPECT_THAT(end.out, HasSubstr("There is no model of this clip."));
  EXPECT_THAT(end.out, HasSubstr("data-ready=\"yes\""));
}

TEST_F(Show, AModelThatFailedSaysSoThoughNothingIsKnownOfItsErrors) {
  fs::create_directory(Path("failed"));
  WriteBytes(Path("failed/summary.json"),
             R"({"registered": 0, "frames": 20, "points": 0, "quality": "failed", "reasons": [],
                 "termination": "static camera"})");
  const ClipReport report = ReadClipReport(Path("failed"));
  EXPECT_THAT(report.sentences, testing::ElementsAre("There is no model: static camera"));
}

TEST_F(Show, CountsOfAModelThatAreNoneAreAnError) {
  fs::create_directory(Path("lies"));
  for (const char* frames : {"-1", "2.7", "1e300", "\"2\""}) {
    WriteBytes(Path("lies/summary.json"),
               fmt::format(R"({{"registered": 0, "frames": {}, "points": 0}})", frames));
    EXPECT_THAT([&] { ReadClipReport(Path("lies")); },
                testing::ThrowsMessage<Error>(HasSubstr("summary.json")))
        << frames;
  }
}

// The numbers of a page have five digits.
TEST_F(Show, APageOfAModelOnAMapIsThatOfOneAtTheOrigin) {
  const TrackFile tracks = ReadTrackFile(Path("a.tracks"));
  const auto sequence = OpenSequence(clip_);
  const auto page = [&](const Eigen::Vector3d& shift) {
    ClipReport report = ReadClipReport(Path("model"));
    for (auto& [frame, cam_from_world] : report.model.cam_from_world) {
      cam_from_world.translation -= cam_from_world.rotation * shift;
    }
    for (auto& [feature, point] : report.model.points) point.in_world += shift;
    WriteClipReport(Path("map.html"), report, tracks, *sequence);
    const std::string html = ReadBytes(Path("map.html"));
    const std::size_t begin = html.find("\"cameras\":");
    const std::size_t end = html.find("\"rgb\":", begin);
    std::vector<double> numbers;
    std::string digits;
    for (const char c : html.substr(begin, end - begin)) {
      if (std::string_view("+-.e0123456789").find(c) != std::string_view::npos) {
        digits += c;
      } else {
        char* last = nullptr;
        const double number = std::strtod(digits.c_str(), &last);
        if (last != digits.c_str()) numbers.push_back(number);
        digits.clear();
      }
    }
    return numbers;
  };
  const std::vector<double> near = page({0.0, 0.0, 0.0});
  const std::vector<double> far = page({456789.0, 5412345.0, 312.0});
  ASSERT_GT(near.size(), 20u * 20u);
  ASSERT_EQ(far.size(), near.size());
  for (std::size_t i = 0; i < near.size(); ++i)
    ASSERT_NEAR(far[i], near[i], 1e-4 + 1e-4 * std::abs(near[i]));
}

// Noise is what takes most bytes.
TEST_F(Show, KeepsThePageOfALongClipSmall) {
  // To and fro along a short path, as rendering takes long; the noise is each frame's own.
  constexpr int kRendered = 80;
  Run(fmt::format("synth {} --frames {} --width-px 320 --height-px 240 --focal-px 260 --quiet",
                  Path("path"),
                  kRendered));
  fs::create_directory(Path("long"));
  for (int i = 0; i < 300; ++i) {
    const int phase = i % (2 * kRendered - 2);
    fs::create_hard_link(
        Path(fmt::format("path/rgb/{:06}.png", std::min(phase, 2 * kRendered - 2 - phase))),
        Path(fmt::format("long/{:06}.png", i)));
  }
  Run("degrade " + Path("long") + " " + Path("dark") + " --level medium --quiet");
  Run("track " + Path("dark") + " --camera 260,260,159.5,119.5 --tracker klt --features 200 " +
      "--quiet --out " + Path("long.tracks"));
  Run("reconstruct " + Path("long.tracks") + " --quiet --out " + Path("long_model"));
  Run("show " + Path("long.tracks") + " --model " + Path("long_model") + " --quiet --out " +
      Path("long.html"));
  EXPECT_LT(fs::file_size(Path("long.html")), 8'000'000u);
  if (test::Browser().empty()) return;
  const nlohmann::json used = Use(Path("long.html"), 1200);
  EXPECT_EQ(used.at("shown"), 150);
  EXPECT_EQ(used.at("bare"), 0) << "every frame shows some of its features";
  EXPECT_THAT(used.at("said").at(0).get<std::string>(), HasSubstr("150 of 300 frames"));
  EXPECT_THAT(used.at("said").at(0).get<std::string>(), HasSubstr(" tracks, the longest."));
  EXPECT_THAT(used.at("complaints"), IsEmpty());
}

}  // namespace
}  // namespace cohort
