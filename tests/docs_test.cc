// Every page of the repository can be read on a laptop, and what it points to is there.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <vector>

#include "frontend/storage/output.h"
#include "tests/support/source_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxColumns = 120;

// The folders that hold the repository's own pages, and the root's own.
const std::set<std::string> kFolders{
    "backend", "datasets", "docs", "frontend", "pipelines", "tests"};

std::vector<fs::path> Pages() {
  std::vector<fs::path> pages;
  for (const auto& entry : fs::directory_iterator(test::SourceDir())) {
    if (entry.path().extension() == ".md") pages.push_back(entry.path());
    if (!entry.is_directory() || !kFolders.contains(entry.path().filename().string())) continue;
    for (auto it = fs::recursive_directory_iterator(entry.path());
         it != fs::recursive_directory_iterator();
         ++it) {
      if (it->path().filename() == "node_modules") it.disable_recursion_pending();
      if (it->path().extension() == ".md") pages.push_back(it->path());
    }
  }
  std::sort(pages.begin(), pages.end());
  return pages;
}

std::size_t Columns(const std::string& line) {  // of UTF-8
  return static_cast<std::size_t>(
      std::count_if(line.begin(), line.end(), [](char c) { return (c & 0xC0) != 0x80; }));
}

std::string Place(const fs::path& page, std::size_t line, const std::string& what) {
  return fs::relative(page, test::SourceDir()).string() + " line " + std::to_string(line) + ": " +
         what;
}

// Lines of tables and of code that do not fit.
std::vector<std::string> WideLines(const fs::path& page, const std::string& text) {
  std::vector<std::string> wide;
  std::istringstream lines(text);
  std::string line;
  bool in_code = false;
  for (std::size_t i = 1; std::getline(lines, line); ++i) {
    if (line.starts_with("```")) in_code = !in_code;
    if ((in_code || line.starts_with("|")) && Columns(line) > kMaxColumns) {
      wide.push_back(Place(page, i, std::to_string(Columns(line)) + " columns"));
    }
  }
  return wide;
}

// [text](target) whose target is no file of the repository; not links to the web or into the page.
std::vector<std::string> DeadLinks(const fs::path& page, const std::string& text) {
  static const std::regex kLink(R"(\]\(([^)\s#]+)(#[^)]*)?\))");
  std::vector<std::string> dead;
  std::istringstream lines(text);
  std::string line;
  for (std::size_t i = 1; std::getline(lines, line); ++i) {
    for (auto it = std::sregex_iterator(line.begin(), line.end(), kLink);
         it != std::sregex_iterator();
         ++it) {
      const std::string target = (*it)[1];
      if (target.find("://") != std::string::npos) continue;
      if (!fs::exists(page.parent_path() / target)) dead.push_back(Place(page, i, target));
    }
  }
  return dead;
}

// `frontend/track/measure/feature.h` and the like that are not there.
std::vector<std::string> MissingFiles(const fs::path& page, const std::string& text) {
  static const std::regex kFile(
      R"(`((?:backend|datasets|docs|frontend|pipelines|tests)/[\w./-]*\w)[`/ ])");
  std::vector<std::string> missing;
  std::istringstream lines(text);
  std::string line;
  for (std::size_t i = 1; std::getline(lines, line); ++i) {
    for (auto it = std::sregex_iterator(line.begin(), line.end(), kFile);
         it != std::sregex_iterator();
         ++it) {
      const std::string file = (*it)[1];
      if (!fs::exists(test::SourceDir() / file)) missing.push_back(Place(page, i, file));
    }
  }
  return missing;
}

TEST(Pages, TablesAndCodeFitIntoALaptopsWindow) {
  for (const fs::path& page : Pages()) {
    EXPECT_THAT(WideLines(page, ReadBytes(page)), testing::IsEmpty());
  }
}

TEST(Pages, LinkToWhatIsThere) {
  for (const fs::path& page : Pages()) {
    EXPECT_THAT(DeadLinks(page, ReadBytes(page)), testing::IsEmpty());
  }
}

TEST(Pages, NameFilesThatExist) {
  for (const fs::path& page : Pages()) {
    EXPECT_THAT(MissingFiles(page, ReadBytes(page)), testing::IsEmpty());
  }
}

// The tests above can fail.
TEST(Pages, FaultsAreFound) {
  const fs::path page = test::SourceDir() / "docs/page.md";
  EXPECT_THAT(WideLines(page, std::string("|").append(120, '-').append("\n")), testing::SizeIs(1));
  EXPECT_THAT(
      WideLines(page, std::string(200, 'x').append("\n```\n").append(121, 'x').append("\n```\n")),
      testing::ElementsAre("docs/page.md line 3: 121 columns"));
  EXPECT_THAT(DeadLinks(page, "[a](results/none.md) [b](https://x.org) [c](../README.md)"),
              testing::ElementsAre("docs/page.md line 1: results/none.md"));
  EXPECT_THAT(MissingFiles(page, "`frontend/none.h` and `frontend/core/error.h`"),
              testing::ElementsAre("docs/page.md line 1: frontend/none.h"));
}

}  // namespace
}  // namespace cohort
