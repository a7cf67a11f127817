// pipelines/workflow: run by the real Snakemake, on this machine and through a real Slurm.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <stdio.h>

#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "frontend/storage/output.h"
#include "tests/support/shell.h"
#include "tests/support/source_dir.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using std::chrono::milliseconds;
using test::ProgramEnd;
using test::RunShell;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::IsSupersetOf;
using testing::Not;

bool IsThere(const std::string& programs) {
  return RunShell("PATH=$PATH:/usr/sbin; command -v " + programs).exit_code == 0;
}

bool Await(const std::function<bool()>& holds, std::chrono::seconds most) {
  const auto end = std::chrono::steady_clock::now() + most;
  while (!holds()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(milliseconds(20));
  }
  return true;
}

// A folder as a user's, with a small clip and a config.
class Workflow : public testing::Test {
 protected:
  void SetUp() override {
    if (!IsThere("snakemake")) GTEST_SKIP() << "no snakemake: apt-get install snakemake";
    const ProgramEnd end =
        Run("cohort synth clip --width-px 160 --height-px 120 --focal-px 130 --frames 12 --quiet");
    ASSERT_EQ(end.exit_code, 0) << end.err;
    WriteBytes(dir_ / "config.yaml",
               fmt::format(R"(
out: out
grid:
  clips: [clip]
  shards: 2
  options:
    levels: [clean, medium]
    trackers: [klt, subspace]
    seeds: [{}]
    backends: ceres
    features: 80
)",
                           seeds_));
  }

  ProgramEnd Run(const std::string& command) const { return RunShell(Shell() + command); }

  std::string Shell() const {
    return fmt::format("cd {} && export PATH={}:$PATH{} && ",
                       dir_.path().string(),
                       test::BuildDir().string(),
                       environment_);
  }

  static std::string Snakemake(const std::string& where) {
    const fs::path workflow = test::SourceDir() / "pipelines/workflow";
    return fmt::format("snakemake --snakefile {} --configfile config.yaml {}",
                       (workflow / "Snakefile").string(),
                       where);
  }

  // The files of the cells that say what came out and how long it took.
  std::map<std::string, std::string> FinishedCells() const {
    std::map<std::string, std::string> cells;
    for (const auto& entry : fs::recursive_directory_iterator(dir_ / "out/grid/cells")) {
      const std::string name = entry.path().filename().string();
      if (name != "tracks.json" && name != "ceres.json") continue;
      const auto written = fs::last_write_time(entry.path()).time_since_epoch().count();
      cells[entry.path().string()] = fmt::format("{} {}", written, ReadBytes(entry.path()));
    }
    return cells;
  }

  bool AnyCellIsFinished() const {
    return fs::exists(dir_ / "out/grid/cells") && !FinishedCells().empty();
  }

  // What was finished has not been touched.
  static void ExpectKept(const std::map<std::string, std::string>& kept,
                         const std::map<std::string, std::string>& now) {
    EXPECT_THAT(now, IsSupersetOf(kept));
  }

  // The figures without what a clock measured.
  static std::string WithoutTimes(const std::string& csv) {
    std::istringstream in(csv);
    std::string kept;
    for (std::string line; std::getline(in, line);) {
      if (line.find("time") == std::string::npos && line.find("seconds") == std::string::npos) {
        kept += line + "\n";
      }
    }
    return kept;
  }

  // The same grid by one run of `cohort compare`.
  std::string ResultsOfOneRun() const {
    const ProgramEnd end =
        Run("cohort compare clip --levels clean,medium --trackers klt,subspace --seeds " + seeds_ +
            " --backends ceres --features 80 --jobs 2 --out one --quiet");
    EXPECT_EQ(end.exit_code, 0) << end.err;
    return WithoutTimes(ReadBytes(dir_ / "one/results.csv"));
  }

  const std::string seeds_ = "1,2,3";
  static constexpr std::size_t kFiles = 24;  // two of each of 12 cells
  const test::TempDir dir_;
  std::string environment_;
};

TEST_F(Workflow, AKilledRunGoesOnAndGivesTheResultsOfOne) {
  // Killed when the first cells are finished and others are not.
  const std::string killed =
      "{ setsid " + Snakemake("--cores 2") + " >log 2>&1 & echo $! >pid; wait $!; }";
  ProgramEnd first;
  std::thread run([&] { first = Run(killed); });
  const bool began = Await([this] { return AnyCellIsFinished(); }, std::chrono::seconds(60));
  const int killed_all = kill(-std::stoi(ReadBytes(dir_ / "pid")), SIGTERM);  // setsid: its group
  run.join();
  ASSERT_TRUE(began) << ReadBytes(dir_ / "log");
  ASSERT_EQ(killed_all, 0);
  EXPECT_NE(first.exit_code, 0);
  const auto kept = FinishedCells();
  ASSERT_FALSE(kept.empty());
  ASSERT_LT(kept.size(), kFiles);

  const ProgramEnd second = Run(Snakemake("--cores 2"));
  ASSERT_EQ(second.exit_code, 0) << second.err;
  const auto all = FinishedCells();
  ExpectKept(kept, all);
  EXPECT_EQ(all.size(), kFiles);
  EXPECT_EQ(WithoutTimes(ReadBytes(dir_ / "out/grid/results.csv")), ResultsOfOneRun());
  EXPECT_THAT(ReadBytes(dir_ / "out/grid/report.html"), HasSubstr("<html"));

  // What is done stays done. A shard that is lost when the results are there is done again, and the
  // others' cells stay.
  const ProgramEnd third = Run(Snakemake("--cores 2"));
  EXPECT_THAT(third.err, HasSubstr("Nothing to be done"));
  fs::remove(dir_ / "out/grid/shards/1_of_2");
  const std::string lost = all.rbegin()->first;
  fs::remove(lost);
  ASSERT_EQ(Run(Snakemake("--cores 2")).exit_code, 0);
  auto again = FinishedCells();
  EXPECT_EQ(again.erase(lost), 1u);
  auto others = all;
  others.erase(lost);
  EXPECT_EQ(again, others);
}

// The rows of scenes.csv by name; no cell of these has a comma.
using Rows = std::map<std::string, std::map<std::string, std::string>>;

Rows ReadScenes(const fs::path& path) {
  std::istringstream in(ReadBytes(path));
  const auto words = [](const std::string& line) {
    std::vector<std::string> cells;
    std::istringstream cell(line);
    for (std::string word; std::getline(cell, word, ',');) cells.push_back(word);
    return cells;
  };
  std::string line;
  std::getline(in, line);
  const auto columns = words(line);
  Rows rows;
  while (std::getline(in, line)) {
    const auto cells = words(line);
    auto& row = rows[cells.at(0)];
    for (std::size_t i = 0; i < columns.size(); ++i)
      row[columns[i]] = i < cells.size() ? cells[i] : "";
  }
  return rows;
}

TEST_F(Workflow, AClipThatFailsIsARowAndStopsNoOther) {
  WriteBytes(dir_ / "empty.mp4", "");
  WriteBytes(dir_ / "config.yaml", R"(
out: out
scenes:
  clips: {none: none.mp4, empty: empty.mp4, good: clip}
  options: {features: 150, second-pass: off, track.cuts: on}
)");
  const ProgramEnd end = Run(Snakemake("--cores 2"));
  ASSERT_EQ(end.exit_code, 0) << end.err;
  const Rows rows = ReadScenes(dir_ / "out/scenes.csv");
  ASSERT_EQ(rows.size(), 3u);
  const json summary = json::parse(ReadBytes(dir_ / "out/scenes/good/summary.json"));
  const auto& good = rows.at("good");
  EXPECT_EQ(good.at("registered"), "12");
  EXPECT_EQ(good.at("frames"), "12");
  EXPECT_EQ(good.at("quality"), summary["quality"]);
  EXPECT_EQ(good.at("points"), std::to_string(summary["points"].get<int>()));
  const auto expected_error = summary["expected_error"].get<double>();
  EXPECT_NEAR(
      std::stod(good.at("expected_error_percent")), 100.0 * expected_error, 5.0 * expected_error);
  for (const char* failed : {"none", "empty"}) {
    EXPECT_EQ(rows.at(failed).at("quality"), "failed");
    EXPECT_EQ(rows.at(failed).at("exit_code"), "1");
    EXPECT_EQ(rows.at(failed).at("expected_error_percent"), "");
    EXPECT_THAT(rows.at(failed).at("note"), HasSubstr(failed));
  }
  EXPECT_THAT(end.out, HasSubstr("expected_error_percent"));  // it is printed, too
  EXPECT_THAT(Run(Snakemake("--cores 2")).err, HasSubstr("Nothing to be done"));
}

TEST_F(Workflow, AConfigThatIsWrongSaysHow) {
  const auto error_of = [this](const std::string& config) {
    WriteBytes(dir_ / "config.yaml", config);
    const ProgramEnd end = Run(Snakemake("--cores 1"));
    EXPECT_NE(end.exit_code, 0);
    return end.err;
  };
  EXPECT_THAT(error_of("out: out\n"), HasSubstr("neither 'grid' nor 'scenes'"));
  EXPECT_THAT(error_of("grid: {clips: [clip], sharts: 3}\n"), HasSubstr("unknown sharts"));
  EXPECT_THAT(error_of("grid: {clips: []}\n"), HasSubstr("no 'clips'"));
  EXPECT_THAT(error_of("grid: {clips: [clip], shards: two}\n"), HasSubstr("'shards'"));
  EXPECT_THAT(error_of("cohort: none/such\ngrid: {clips: [clip]}\n"),
              HasSubstr("no program 'none/such'"));
  EXPECT_THAT(error_of("scenes: {clips: [a/hall.mp4, b/hall.mp4]}\n"), HasSubstr("called hall"));
  EXPECT_THAT(error_of("grid: {clips: clip}\n"), HasSubstr("give a list"));
  EXPECT_THAT(error_of("scenes: {clips: [5]}\n"), HasSubstr("has '5': give paths"));
  EXPECT_THAT(error_of("scenes: {clips: ['br{a}']}\n"), HasSubstr("braces"));
  EXPECT_THAT(error_of("scenes: {clips: {a: x, a.log: y}}\n"), HasSubstr("another one's files"));
  EXPECT_THAT(error_of("scenes: {clips: [clip], options: [4]}\n"), HasSubstr("'options'"));
  EXPECT_THAT(error_of("out: ''\nscenes: {clips: [clip]}\n"), HasSubstr("'out'"));
}

TEST_F(Workflow, TheOutputFoldersNameIsNoMoreThanAName) {
  WriteBytes(dir_ / "config.yaml",
             "out: 'o $(touch planted) \"u\" t'\nscenes: {clips: {none: no_such_clip}}\n");
  Run(Snakemake("--cores 1"));
  EXPECT_FALSE(fs::exists(dir_ / "planted"));
  EXPECT_TRUE(fs::exists(dir_ / "o $(touch planted) \"u\" t/scenes/none.json"));
}

// Slurm lives as long as the pipe to its script is open.
class WorkflowOnSlurm : public Workflow {
 protected:
  void SetUp() override {
    if (!IsThere("slurmctld && command -v slurmd && command -v munged")) {
      GTEST_SKIP() << "no Slurm: apt-get install slurm-wlm munge";
    }
    Workflow::SetUp();
    if (IsSkipped() || HasFatalFailure()) return;
    const fs::path folder = slurm_dir_.path();
    const fs::path script = test::SourceDir() / "tests/pipelines/workflow/one_node_slurm";
    const std::string log = folder / "start.log";
    slurm_ =
        popen(fmt::format("{} {} >{} 2>&1", script.string(), folder.string(), log).c_str(), "w");
    ASSERT_NE(slurm_, nullptr);
    ASSERT_TRUE(Await([&] { return fs::exists(folder / "ready"); }, std::chrono::seconds(20)))
        << ReadBytes(log) << ReadBytes(folder / "controller.log") << ReadBytes(folder / "node.log");
    environment_ = fmt::format(" SLURM_CONF={}/slurm.conf", folder.string());
  }

  void TearDown() override {
    if (slurm_ != nullptr) pclose(slurm_);
  }

  static std::string OnSlurm() {
    // As a user's call, but for looking every second ($CI), not every ten.
    return "CI=true " +
           Snakemake(fmt::format("--profile {} --max-status-checks-per-second 10 --latency-wait 10",
                                 (test::SourceDir() / "pipelines/workflow/slurm").string()));
  }

  const test::TempDir slurm_dir_;
  FILE* slurm_ = nullptr;
};

TEST_F(WorkflowOnSlurm, ACancelledShardKeepsItsFinishedCells) {
  ProgramEnd first;
  std::thread run([&] { first = Run(OnSlurm()); });
  const bool began = Await([this] { return AnyCellIsFinished(); }, std::chrono::seconds(60));
  const ProgramEnd cancel = Run("scancel $(squeue -h -o %A)");
  run.join();
  ASSERT_TRUE(began) << first.err;
  ASSERT_EQ(cancel.exit_code, 0) << cancel.err;
  EXPECT_NE(first.exit_code, 0) << first.err;
  const auto kept = FinishedCells();
  ASSERT_FALSE(kept.empty());
  ASSERT_LT(kept.size(), kFiles);

  const ProgramEnd second = Run(OnSlurm());
  ASSERT_EQ(second.exit_code, 0) << second.err;
  const auto all = FinishedCells();
  ExpectKept(kept, all);
  EXPECT_EQ(all.size(), kFiles);
  EXPECT_EQ(WithoutTimes(ReadBytes(dir_ / "out/grid/results.csv")), ResultsOfOneRun());
  // Every job was one of Slurm.
  EXPECT_THAT(Run("ls slurm_logs").out, testing::AllOf(HasSubstr("shard-"), HasSubstr("collect-")));
}

TEST_F(WorkflowOnSlurm, ACancelledSceneGoesOnAndStopsNoOther) {
  WriteBytes(dir_ / "config.yaml", R"(
out: out
scenes:
  clips: {short: clip, long: long}
  options: {features: 150}
)");
  ASSERT_EQ(
      Run("cohort synth long --width-px 320 --height-px 240 --focal-px 260 --frames 40 --quiet")
          .exit_code,
      0);
  ProgramEnd first;
  std::thread run([&] { first = Run(OnSlurm()); });
  // The long one is cancelled by the name of its job when it has begun and the short one is done.
  const fs::path tracks = dir_ / "out/scenes/long/clip.tracks";
  const bool began = Await([&] { return fs::exists(tracks); }, std::chrono::seconds(60));
  const ProgramEnd cancel = Run("scancel --name=cohort-scene-scene=long");
  run.join();
  ASSERT_TRUE(began) << first.err;
  ASSERT_EQ(cancel.exit_code, 0) << cancel.err;
  EXPECT_NE(first.exit_code, 0) << first.err;
  // The table is there all the same.
  const Rows rows = ReadScenes(dir_ / "out/scenes.csv");
  EXPECT_EQ(rows.at("short").at("registered"), "12") << first.out;
  EXPECT_THAT(rows.at("long").at("note"), HasSubstr("not finished"));

  const std::string kept = ReadBytes(dir_ / "out/scenes/short.json");
  const ProgramEnd second = Run(OnSlurm());
  ASSERT_EQ(second.exit_code, 0) << second.err;
  EXPECT_EQ(ReadBytes(dir_ / "out/scenes/short.json"), kept);
  EXPECT_EQ(ReadScenes(dir_ / "out/scenes.csv").at("long").at("registered"), "40");
  EXPECT_FALSE(fs::exists(dir_ / "out/scenes/long.json.begun"));
}

}  // namespace
}  // namespace cohort
