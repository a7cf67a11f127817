// report.html in a real browser: it draws, it complains of nothing, it shows what results.csv has.

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "frontend/core/statistics.h"
#include "frontend/storage/output.h"
#include "tests/support/browser.h"
#include "tests/support/program.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Each;
using testing::Ge;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Le;
using testing::Not;
using testing::SizeIs;

// Put into a copy of the page: collects errors from the start, and at the end what there is to see.
constexpr const char* kProbeHead = R"(<script nonce="probe">
window.complaints = [];
addEventListener('error', (event) => complaints.push(String(event.message)));
addEventListener('securitypolicyviolation', (event) => complaints.push(event.violatedDirective + ' ' + event.blockedURI));
for (const kind of ['error', 'warn']) {
  console[kind] = (...what) => complaints.push(what.join(' '));
}
</script>)";
constexpr const char* kProbeFoot = R"(<script nonce="probe">
addEventListener('load', () => setTimeout(() => {
  const coloursOf = (canvas) => {
    const copy = document.createElement('canvas');
    copy.width = canvas.width;
    copy.height = canvas.height;
    const context = copy.getContext('2d');
    context.drawImage(canvas, 0, 0);
    const words = new Uint32Array(context.getImageData(0, 0, copy.width, copy.height).data.buffer);
    return new Set(words).size;
  };
  const text = (element) => element.textContent;
  const probe = {
    complaints,
    ready: document.body.dataset.ready || null,
    fetched: performance.getEntriesByType('resource').map((r) => r.name.slice(0, 80))
        .filter((name) => !name.startsWith('data:')),
    headings: [...document.querySelectorAll('h2')].map(text),
    plots: [...document.querySelectorAll('.plot canvas')].map(coloursOf),
    views: [...document.querySelectorAll('.view canvas')].map(coloursOf),
    pictures: [...document.images].map((image) => image.naturalWidth),
    headline: [...document.querySelectorAll('#headline tbody tr')].map(text),
    others: [...document.querySelectorAll('#others tbody tr')].map(text),
    cells: [...document.querySelectorAll('#cells tbody tr')].map((row) => ({
      names: [...row.querySelectorAll('td.name')].map(text),
      values: Object.fromEntries([...row.querySelectorAll('td[data-metric]')].map(
          (td) => [td.dataset.metric, [Number(td.dataset.value), td.firstChild.textContent]])),
    })),
    wider: document.documentElement.scrollWidth - innerWidth,
  };
  const out = document.createElement('pre');
  out.id = 'probe';
  out.textContent = JSON.stringify(probe);
  top.document.body.append(out);
}, 500));
</script>)";

class Report : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    dir_ = new test::TempDir;
    ASSERT_EQ(test::RunCohort("synth " + Path("clip") +
                              " --frames 16 --width-px 320 --height-px 240 --focal-px 260 --quiet")
                  .exit_code,
              0);
    const test::ProgramEnd end = test::RunCohort(Compare("out"));
    ASSERT_EQ(end.exit_code, 0) << end.err;
  }
  static void TearDownTestSuite() {
    delete dir_;
    dir_ = nullptr;
  }

  static std::string Path(const std::string& name) { return *dir_ / name; }
  static std::string Compare(const std::string& out) {
    return "compare " + Path("clip") +
           " --levels clean,medium --seeds 1,2 --trackers klt15,klt21,anchored-klt15,subspace,"
           "ceiling --backends ceres,triangulation --features 150 --jobs 2 --quiet --resume "
           "--out " +
           Path(out);
  }

  // What there is to see at a width, by one browser each.
  static const nlohmann::json& Probe(int width_px) {
    static std::map<int, nlohmann::json> probes;
    const auto found = probes.find(width_px);
    return found != probes.end() ? found->second : probes[width_px] = Browsed(width_px);
  }

  static nlohmann::json Browsed(int width_px) {
    std::string page = test::WithProbes(ReadBytes(Path("out/report.html")));
    page.replace(page.find("<head>"), 6, std::string("<head>") + kProbeHead);
    page.replace(page.rfind("</body>"), 7, std::string(kProbeFoot) + "</body>");
    WriteBytes(Path("probed.html"), test::Framed(page, width_px, 900));
    const test::ProgramEnd end =
        test::Browse(Path("probed.html"), "--window-size=1200,900 --dump-dom", dir_->path());
    const auto json = test::Probe(end.out);
    if (!json) {
      ADD_FAILURE() << "the page did not come to its end\n" << end.err;
      return {};
    }
    return nlohmann::json::parse(*json);
  }

  static test::TempDir* dir_;
};
test::TempDir* Report::dir_ = nullptr;

// sequence, level, tracker, backend, metric -> values over seeds
using Figures = std::map<std::vector<std::string>, std::vector<double>>;

Figures ReadCsv(const fs::path& path) {
  Figures figures;
  std::istringstream in(ReadBytes(path));
  std::string line;
  std::getline(in, line);
  while (std::getline(in, line)) {
    std::vector<std::string> words;
    std::istringstream row(line);
    for (std::string word; std::getline(row, word, ',');) words.push_back(word);
    figures[{words[0], words[1], words[2], words[3], words[5]}].push_back(std::stod(words[6]));
  }
  return figures;
}

TEST_F(Report, OpensOfflineAndDrawsEverythingWithoutComplaint) {
  if (test::Browser().empty()) GTEST_SKIP() << "no chromium";
  const auto& probe = Probe(1200);
  ASSERT_FALSE(probe.is_null());
  EXPECT_EQ(probe["ready"], "true");
  EXPECT_THAT(probe["complaints"].get<std::vector<std::string>>(), IsEmpty());
  EXPECT_THAT(probe["fetched"].get<std::vector<std::string>>(), IsEmpty());
  for (const char* heading : {"Who won, and by how much",
                              "The other rivals",
                              "Where cohort does not win",
                              "Error against darkness",
                              "The tracks over the darkest frame",
                              "The reconstructions in 3-D",
                              "Does the tracker know how wrong it is?",
                              "Every figure",
                              "Failures"}) {
    EXPECT_THAT(probe["headings"].get<std::vector<std::string>>(), testing::Contains(heading));
  }
  ASSERT_EQ(probe["plots"].size(), 4u + 2u);  // curves, histograms of two levels
  for (const int colours : probe["plots"]) EXPECT_GT(colours, 50);
  ASSERT_EQ(probe["views"].size(), 2u);
  for (const int colours : probe["views"]) EXPECT_GT(colours, 3);  // ground, points, two paths
  ASSERT_EQ(probe["pictures"].size(), 5u);
  for (const int width : probe["pictures"]) EXPECT_EQ(width, 320);
  EXPECT_EQ(probe["headline"].size(), 4u);  // levels x backends
  const auto others = nlohmann::json::parse(ReadBytes(Path("out/results.json")))["headline"];
  EXPECT_EQ(probe["others"].size(), others["runs"].size() - 2u * 4u);  // but cohort and KLT
}

// Truth with z up and on a map, as of a survey: seen upright, and about its middle.
TEST_F(Report, ShowsAWorldOfAnyKindUprightAndNearItsOrigin) {
  fs::copy(Path("clip"), Path("survey"), fs::copy_options::recursive);
  fs::remove(Path("survey/scene.json"));
  const Eigen::Quaterniond turn(Eigen::AngleAxisd(-0.5 * M_PI, Eigen::Vector3d::UnitX()));
  std::istringstream in(ReadBytes(Path("clip/groundtruth.txt")));
  std::string turned;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with('#')) continue;
    std::istringstream words(line);
    std::string time;
    words >> time;
    std::array<double, 7> pose{};
    for (double& value : pose) words >> value;
    Eigen::Map<Eigen::Vector3d> t(pose.data());
    Eigen::Map<Eigen::Quaterniond> q(pose.data() + 3);
    t = turn * t + Eigen::Vector3d(456789.0, 5412345.0, 312.0);
    q = turn * q;
    turned += fmt::format("{} {}\n", time, fmt::join(pose, " "));
  }
  WriteBytes(Path("survey/groundtruth.txt"), turned);
  const test::ProgramEnd end =
      test::RunCohort("compare " + Path("survey") +
                      " --levels clean --seeds 1 --trackers anchored-klt31,subspace "
                      "--backends ceres --features 100 --quiet --out " +
                      Path("surveyed"));
  ASSERT_EQ(end.exit_code, 0) << end.err;
  const std::string page = ReadBytes(Path("surveyed/report.html"));
  const auto list = [&page](const std::string& name) {
    const std::size_t begin = page.find("\"" + name + "\":[");
    EXPECT_NE(begin, std::string::npos) << name;
    const std::size_t open = page.find('[', begin);
    const std::string text = page.substr(open, page.find(']', open) + 1 - open);
    return nlohmann::json::parse(text).get<std::vector<double>>();
  };
  EXPECT_GT(list("up").at(2), 0.9);
  EXPECT_THAT(list("truth"), AllOf(SizeIs(3 * 16), Each(AllOf(Ge(-20.0), Le(20.0)))));
  EXPECT_THAT(list("path"), AllOf(SizeIs(3 * 16), Each(AllOf(Ge(-20.0), Le(20.0)))));
}

TEST_F(Report, ShowsWhatResultsCsvHas) {
  if (test::Browser().empty()) GTEST_SKIP() << "no chromium";
  const auto& probe = Probe(1200);
  ASSERT_FALSE(probe.is_null());
  const Figures figures = ReadCsv(Path("out/results.csv"));
  EXPECT_EQ(probe["cells"].size(), 2u * 2u * 5u);
  std::size_t compared = 0;
  for (const auto& cell : probe["cells"]) {
    const auto names = cell["names"].get<std::vector<std::string>>();
    ASSERT_EQ(names.size(), 4u);
    for (const auto& [metric, shown] : cell["values"].items()) {
      std::vector<std::string> key(names);
      key.push_back(metric);
      if (!figures.contains(key)) key[3].clear();  // a figure of the tracks
      ASSERT_TRUE(figures.contains(key)) << metric;
      const double median = InterpolatedMedian(figures.at(key));
      EXPECT_NEAR(shown[0].get<double>(), median, 1e-12 * median);
      const bool is_length = metric == "ate" || metric == "point_error_median";
      const double printed = std::stod(shown[1].get<std::string>()) / (is_length ? 1000.0 : 1.0);
      EXPECT_NEAR(printed, median, 0.01 * median + 1e-4) << metric;  // three digits
      ++compared;
    }
  }
  EXPECT_GT(compared, 100u);
}

TEST_F(Report, FitsAPhoneAndIsNotBlankThere) {
  if (test::Browser().empty()) GTEST_SKIP() << "no chromium";
  for (const int width_px : {360, 500}) {
    const auto& probe = Probe(width_px);
    ASSERT_FALSE(probe.is_null());
    EXPECT_LE(probe["wider"], 0) << width_px;
  }
  WriteBytes(Path("phone.html"), test::Framed(ReadBytes(Path("out/report.html")), 360, 3000));
  test::Browse(
      Path("phone.html"), "--window-size=500,3000 --screenshot=" + Path("phone.png"), dir_->path());
  cv::Mat picture = cv::imread(Path("phone.png"), cv::IMREAD_GRAYSCALE);
  ASSERT_FALSE(picture.empty());
  picture = picture(cv::Rect(0, 0, 360, picture.rows));
  for (int y = 0; y + 600 <= picture.rows; y += 600) {
    cv::Scalar mean;
    cv::Scalar deviation;
    cv::meanStdDev(picture(cv::Rect(0, y, picture.cols, 600)), mean, deviation);
    EXPECT_GT(deviation[0], 5.0) << "rows from " << y;
  }
}

TEST_F(Report, SameExperimentSameBytes) {
  ASSERT_EQ(test::RunCohort(Compare("again")).exit_code, 0);
  const std::string page = ReadBytes(Path("out/report.html"));
  EXPECT_TRUE(page == ReadBytes(Path("again/report.html")));
  EXPECT_THAT(page, Not(HasSubstr("@@COHORT_DATA@@")));
  EXPECT_THAT(page, Not(HasSubstr(dir_->path().string())));
}

}  // namespace
}  // namespace cohort
