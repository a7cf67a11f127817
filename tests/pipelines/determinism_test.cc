// Same input, same bytes: the main commands twice, in another folder, with other threads, another
// language and another time zone.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "frontend/storage/output.h"
#include "tests/support/program.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

// What has to differ, by its name in JSON and in the rows of results: how long something took.
// docs/files.md says so too.
const std::set<std::string> kTimings{"seconds", "ms_per_frame", "detect_time", "track_time"};

Json WithoutTimings(const Json& json) {
  // A name and the fingerprint of a file in which the working folder stands.
  if (json.is_array() && json.size() == 2 && json[0] == "clip.tracks") return json[0];
  if (json.is_array()) {
    Json kept = Json::array();
    for (const Json& item : json) {
      if (!item.is_object() || !kTimings.contains(item.value("metric", ""))) {
        kept.push_back(WithoutTimings(item));
      }
    }
    return kept;
  }
  if (!json.is_object()) return json;
  Json kept = Json::object();
  for (const auto& [name, value] : json.items()) {
    // --threads and --jobs are among the options that a file was made with.
    const bool differs = kTimings.contains(name) || name == "threads" || name == "jobs";
    if (!differs) kept[name] = WithoutTimings(value);
  }
  return kept;
}

std::string WithoutTimingRows(const std::string& csv) {
  std::string kept;
  std::istringstream lines(csv);
  for (std::string line; std::getline(lines, line);) {
    const bool timing = std::any_of(kTimings.begin(), kTimings.end(), [&](const std::string& name) {
      return line.find("," + name + ",") != std::string::npos;
    });
    if (!timing) kept += line + "\n";
  }
  return kept;
}

// All files below a folder, by name; with a name of the same length in place of the folder's own,
// which stands in files that say what they were made of.
std::map<std::string, std::string> Contents(const fs::path& folder) {
  std::map<std::string, std::string> contents;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file() || entry.path().extension() == ".log") continue;
    std::string content = ReadBytes(entry.path());
    if (entry.path().extension() == ".json") content = WithoutTimings(Json::parse(content)).dump();
    if (entry.path().filename() == "results.csv") content = WithoutTimingRows(content);
    const std::string name = folder.string();
    for (std::size_t at = 0; (at = content.find(name, at)) != std::string::npos;) {
      content.replace(at, name.size(), name.size(), '*');
    }
    contents[entry.path().lexically_relative(folder).string()] = std::move(content);
  }
  return contents;
}

// The commands in an empty folder; `around` is put before each of them.
void RunCommands(const fs::path& folder, const std::string& around, int threads) {
  fs::create_directory(folder);
  const std::string program = around + " " + test::ProgramPath() + " ";
  for (const std::string& command :
       {std::string("synth clip --motion lateral --frames 8 --width-px 160 --height-px 120 "
                    "--focal-px 131"),
        fmt::format("track clip --out a.tracks --features 60 --threads {}", threads),
        std::string("export a.tracks --colmap-database a.db --csv a.csv --npz a.npz --opensfm "
                    "a.tsv --covariances c.npz"),
        std::string("reconstruct a.tracks --backend ceres --ceres.covariances --out model"),
        std::string("export a.tracks --model model --bal a.bal"),
        std::string("evaluate model --truth clip --json model.json"),
        std::string("refine a.tracks --model model --images clip --out b.tracks"),
        fmt::format("sfm clip --out scene --features 60 --threads {}", threads),
        fmt::format("compare clip --out grid --trackers klt21,subspace --levels medium --backends "
                    "ceres --seeds 1 --features 60 --jobs {}",
                    threads)}) {
    const test::ProgramEnd end =
        test::RunShell(fmt::format("cd {} && {}{} --quiet", folder.string(), program, command));
    ASSERT_EQ(end.exit_code, 0) << command << ": " << end.err;
  }
}

void ExpectSame(const std::map<std::string, std::string>& a,
                const std::map<std::string, std::string>& b) {
  EXPECT_GT(a.size(), 60u);
  for (const auto& [name, content] : a) {
    ASSERT_TRUE(b.contains(name)) << name;
    EXPECT_TRUE(content == b.at(name)) << name << " differs";
  }
  EXPECT_EQ(a.size(), b.size());
}

TEST(Determinism, SameBytesInAnotherFolderWithOtherThreadsAndAnotherTimeZone) {
  const test::TempDir dir;
  RunCommands(dir / "one", "env TZ=UTC LC_ALL=C OMP_NUM_THREADS=1 taskset -c 0", 1);
  const auto one = Contents(dir / "one");
  // As long a name: it stands in the files.
  RunCommands(dir / "two", "env TZ=Asia/Kathmandu", 2);
  ExpectSame(one, Contents(dir / "two"));
}

TEST(Determinism, SameBytesWhereDecimalsHaveACommaAndTextGoesByOtherRules) {
  const test::TempDir dir;
  const std::string locales = dir / "locales";
  fs::create_directory(locales);
  if (test::RunShell("localedef -i de_DE -f UTF-8 " + locales + "/de_DE.UTF-8").exit_code != 0) {
    GTEST_SKIP() << "needs localedef and the sources of de_DE (Debian: apt-get install locales)";
  }
  const std::string german = "env LOCPATH=" + locales + " LC_ALL=de_DE.UTF-8";
  ASSERT_EQ(test::RunShell(german + " bash -c 'printf %.1f 0,5'").out, "0,5");
  RunCommands(dir / "one", "env LC_ALL=C", 2);
  RunCommands(dir / "two", german, 2);
  ExpectSame(Contents(dir / "one"), Contents(dir / "two"));
}

}  // namespace
}  // namespace cohort
