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

#include "frontend/core/output.h"
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
                       fs::path(COHORT_PROGRAM).parent_path().string(),
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

  // What is done stays done; a lost shard mark costs no cell.
  const ProgramEnd third = Run(Snakemake("--cores 2"));
  EXPECT_THAT(third.err, HasSubstr("Nothing to be done"));
  fs::remove(dir_ / "out/grid/shards/1_of_2");
  ASSERT_EQ(Run(Snakemake("--cores 2")).exit_code, 0);
  EXPECT_EQ(FinishedCells(), all);
}

TEST_F(Workflow, AConfigThatIsWrongSaysHow) {
  const auto error_of = [this](const std::string& config) {
    WriteBytes(dir_ / "config.yaml", config);
    const ProgramEnd end = Run(Snakemake("--cores 1"));
    EXPECT_NE(end.exit_code, 0);
    return end.err;
  };
  EXPECT_THAT(error_of("out: out\n"), HasSubstr("no 'grid'"));
  EXPECT_THAT(error_of("grid: {clips: [clip], sharts: 3}\n"), HasSubstr("unknown sharts"));
  EXPECT_THAT(error_of("grid: {clips: []}\n"), HasSubstr("no 'clips'"));
  EXPECT_THAT(error_of("grid: {clips: [clip], shards: two}\n"), HasSubstr("'shards'"));
  EXPECT_THAT(error_of("cohort: none/such\ngrid: {clips: [clip]}\n"),
              HasSubstr("no program 'none/such'"));
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
  const ProgramEnd cancel = Run("scancel --name=cohort-shard");
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

}  // namespace
}  // namespace cohort
