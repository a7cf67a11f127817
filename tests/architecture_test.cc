#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "tests/support/source_dir.h"

// Who may include whom. Everything flows one way: frames -> tracks -> reconstruction -> figures.
// The CMake targets say the same; this test reads every #include.

namespace cohort {
namespace {

namespace fs = std::filesystem;

// Parts by the folder that they are (the longest that fits counts), and all they may include.
const std::map<std::string, std::set<std::string>> kMayInclude{
    {"frontend/core", {}},
    {"frontend/storage", {"frontend/core"}},
    {"frontend/geometry", {"frontend/core"}},
    {"frontend/tracks", {"frontend/core", "frontend/storage", "frontend/geometry"}},
    {"frontend/image", {"frontend/core", "frontend/storage", "frontend/tracks"}},
    {"frontend/detect", {"frontend/core", "frontend/image"}},
    {"frontend/energy", {"frontend/core", "frontend/image"}},
    {"frontend/track",
     {"frontend/core",
      "frontend/track/loop",
      "frontend/track/baselines",
      "frontend/track/subspace"}},
    {"frontend/track/loop",
     {"frontend/core", "frontend/tracks", "frontend/image", "frontend/detect"}},
    {"frontend/track/baselines",
     {"frontend/core", "frontend/tracks", "frontend/image", "frontend/track/loop"}},
    {"frontend/track/measure",
     {"frontend/core",
      "frontend/tracks",
      "frontend/image",
      "frontend/energy",
      "frontend/track/trajectory_model"}},
    {"frontend/track/second_pass",
     {"frontend/core", "frontend/tracks", "frontend/image", "frontend/track/measure"}},
    {"frontend/track/subspace",
     {"frontend/core",
      "frontend/tracks",
      "frontend/image",
      "frontend/energy",
      "frontend/track/loop",
      "frontend/track/measure",
      "frontend/track/trajectory_model"}},
    {"frontend/track/trajectory_model", {"frontend/core"}},
    {"backend/geometry", {"frontend/core", "frontend/geometry"}},
    {"backend/scene",
     {"frontend/core",
      "frontend/storage",
      "frontend/geometry",
      "frontend/tracks",
      "backend/geometry"}},
    {"backend/adjust",
     {"frontend/core",
      "frontend/geometry",
      "frontend/tracks",
      "backend/geometry",
      "backend/scene"}},
    {"backend/start",
     {"frontend/core",
      "frontend/geometry",
      "frontend/tracks",
      "backend/geometry",
      "backend/scene",
      "backend/adjust"}},
    {"backend/judge",
     {"frontend/core",
      "frontend/geometry",
      "frontend/tracks",
      "backend/geometry",
      "backend/scene",
      "backend/adjust",
      "backend/start"}},
    {"backend/grow",
     {"frontend/core",
      "frontend/geometry",
      "backend/scene",
      "backend/adjust",
      "backend/start",
      "backend/judge"}},
    {"backend/mapper",
     {"frontend/core",
      "frontend/geometry",
      "frontend/tracks",
      "backend/scene",
      "backend/adjust",
      "backend/start",
      "backend/judge",
      "backend/grow"}},
    {"backend/colmap",
     {"frontend/core",
      "frontend/storage",
      "frontend/geometry",
      "frontend/image",
      "frontend/tracks",
      "backend/geometry",
      "backend/scene",
      "backend/start",
      "backend/judge"}},
    {"datasets/readers",
     {"frontend/core",
      "frontend/storage",
      "frontend/geometry",
      "frontend/tracks",
      "frontend/image"}},
    {"datasets/render",
     {"frontend/core",
      "frontend/storage",
      "frontend/geometry",
      "frontend/tracks",
      "frontend/image",
      "datasets/readers"}},
    {"datasets/degrade",
     {"frontend/core",
      "frontend/storage",
      "frontend/geometry",
      "frontend/tracks",
      "frontend/image",
      "datasets/readers",
      "datasets/render"}},
    {"datasets/truth",
     {"frontend/core",
      "frontend/storage",
      "frontend/geometry",
      "frontend/tracks",
      "frontend/image",
      "datasets/readers",
      "datasets/render",
      "datasets/degrade"}},
    {"datasets",
     {"frontend/core",
      "frontend/storage",
      "frontend/geometry",
      "frontend/image",
      "datasets/readers"}},
    {"pipelines/json", {"frontend/core", "frontend/storage"}},
    {"pipelines/sfm", {"frontend", "backend", "datasets", "pipelines/json"}},
    {"pipelines/console", {"frontend/core", "frontend/storage", "pipelines/json", "pipelines/sfm"}},
    {"pipelines/evaluation",
     {"frontend/core",
      "frontend/storage",
      "frontend/geometry",
      "frontend/tracks",
      "datasets",
      "backend",
      "pipelines/json",
      "pipelines/sfm"}},
    {"pipelines/python", {"frontend", "backend", "datasets", "pipelines/json", "pipelines/sfm"}},
    {"pipelines/experiment",
     {"frontend",
      "backend",
      "datasets",
      "pipelines/json",
      "pipelines/console",
      "pipelines/evaluation",
      "pipelines/sfm"}},
    {"pipelines/report",
     {"frontend",
      "backend",
      "datasets",
      "pipelines/json",
      "pipelines/console",
      "pipelines/evaluation",
      "pipelines/sfm",
      "pipelines/experiment"}},
    {"pipelines/commands",
     {"frontend",
      "backend",
      "datasets",
      "pipelines/json",
      "pipelines/console",
      "pipelines/evaluation",
      "pipelines/sfm",
      "pipelines/experiment",
      "pipelines/report"}},
    {"pipelines", {"frontend/core", "frontend/storage", "pipelines/console", "pipelines/commands"}},
};

// Libraries that only one part may show or use: by the start of the include.
const std::map<std::string, std::vector<std::string>> kOnlyIn{
    {"ceres/", {"backend"}},
    {"sqlite3.h", {"frontend/storage"}},
    {"zip.h", {"frontend/storage"}},
    {"libav", {"datasets/readers"}},
    {"libsw", {"datasets/readers"}},
    {"CLI/", {"pipelines/console"}},
    {"nlohmann/", {"datasets/render", "pipelines"}},
    {"pybind11/", {"pipelines/python"}},
};

std::optional<std::string> PartOf(const std::string& path) {
  std::optional<std::string> part;
  for (const auto& [folder, ignored] : kMayInclude) {
    if (path.starts_with(folder + "/") && (!part || folder.size() > part->size())) part = folder;
  }
  return part;
}

std::vector<std::string> IncludesOf(const fs::path& file) {
  static const std::regex kInclude(R"(^\s*#\s*include\s*["<]([^">]+)[">])");
  std::vector<std::string> includes;
  std::ifstream in(file);
  std::smatch match;
  for (std::string line; std::getline(in, line);) {
    if (std::regex_search(line, match, kInclude)) includes.push_back(match[1]);
  }
  return includes;
}

// What is wrong with an include, if anything.
std::optional<std::string> Fault(const std::string& file, const std::string& include) {
  const std::string fault = file + " includes " + include;
  const auto from = PartOf(file);
  if (!from) return file + " is in no part that this test knows";
  for (const auto& [library, parts] : kOnlyIn) {
    if (!include.starts_with(library)) continue;
    const bool allowed = std::any_of(
        parts.begin(), parts.end(), [&](const auto& part) { return file.starts_with(part + "/"); });
    if (!allowed) return fault;
  }
  if (include.starts_with("tests/")) return fault;
  const auto to = PartOf(include);
  if (!to || *to == *from) return std::nullopt;
  // A folder that may be included may be with all that is in it.
  const auto& allowed = kMayInclude.at(*from);
  for (fs::path folder = *to; !folder.empty(); folder = folder.parent_path()) {
    if (allowed.contains(folder.string())) return std::nullopt;
  }
  return file + " (" + *from + ") includes " + include + " (" + *to + ")";
}

TEST(Architecture, NoIncludePointsUpward) {
  const fs::path root = test::SourceDir();
  std::vector<std::string> faults;
  std::size_t files = 0;
  for (const char* top : {"frontend", "backend", "datasets", "pipelines"}) {
    for (const auto& entry : fs::recursive_directory_iterator(root / top)) {
      const std::string extension = entry.path().extension();
      if (extension != ".h" && extension != ".cc") continue;
      ++files;
      const std::string file = entry.path().lexically_relative(root).string();
      for (const std::string& include : IncludesOf(entry.path())) {
        if (const auto fault = Fault(file, include)) faults.push_back(*fault);
      }
    }
  }
  EXPECT_GT(files, 50u);
  EXPECT_THAT(faults, testing::IsEmpty());
}

TEST(Architecture, FindsAnIncludeThatPointsUpward) {
  EXPECT_TRUE(Fault("frontend/tracks/a.h", "frontend/track/tracker.h"));
  EXPECT_TRUE(Fault("frontend/track/a.h", "backend/scene/reconstruction.h"));
  EXPECT_TRUE(Fault("backend/scene/a.cc", "frontend/track/tracker.h"));
  EXPECT_TRUE(Fault("backend/geometry/a.h", "backend/scene/reconstruction.h"));
  EXPECT_TRUE(Fault("backend/scene/a.h", "backend/colmap/database.h"));
  EXPECT_TRUE(Fault("frontend/geometry/a.h", "backend/geometry/triangulation.h"));
  EXPECT_TRUE(Fault("datasets/readers/a.h", "datasets/render/render.h"));
  EXPECT_TRUE(Fault("datasets/a.cc", "pipelines/console/table.h"));
  EXPECT_TRUE(Fault("frontend/track/trajectory_model/a.h", "frontend/track/measure/measurement.h"));
  EXPECT_TRUE(Fault("frontend/track/a.cc", "ceres/ceres.h"));
  EXPECT_TRUE(Fault("backend/scene/a.cc", "tests/support/temp_dir.h"));
  EXPECT_TRUE(Fault("pipelines/sfm/a.cc", "pipelines/console/table.h"));
  EXPECT_TRUE(Fault("pipelines/sfm/a.cc", "pipelines/evaluation/alignment.h"));
  EXPECT_TRUE(Fault("pipelines/experiment/a.cc", "pipelines/commands/track.h"));
  EXPECT_TRUE(Fault("pipelines/evaluation/a.cc", "pipelines/experiment/tasks.h"));
  EXPECT_FALSE(Fault("backend/scene/a.cc", "ceres/ceres.h"));
  EXPECT_FALSE(Fault("backend/scene/a.cc", "frontend/tracks/track_set.h"));
  EXPECT_FALSE(Fault("pipelines/commands/a.cc", "backend/scene/reconstruction.h"));
}

}  // namespace
}  // namespace cohort
