// The site that docs/mkdocs.yml makes of the pages: complete, without a dead link, without a
// network, and readable on a phone.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <string>
#include <vector>

#include "frontend/storage/output.h"
#include "tests/support/browser.h"
#include "tests/support/source_dir.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

// All that `pattern` captures.
std::vector<std::string> Captures(const std::string& text, const char* pattern) {
  const std::regex regex(pattern);
  std::vector<std::string> all;
  for (auto it = std::sregex_iterator(text.begin(), text.end(), regex);
       it != std::sregex_iterator();
       ++it) {
    all.push_back((*it)[1]);
  }
  return all;
}

bool IsOfTheWeb(const std::string& target) {
  return target.find("://") != std::string::npos || target.starts_with("//");
}

// The site, made once for all tests.
class Site : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    dir_ = new test::TempDir;
    if (!HasMkDocs()) return;
    const test::ProgramEnd end =
        test::RunShell(fmt::format("mkdocs build --strict --config-file {} --site-dir {}",
                                   (test::SourceDir() / "docs/mkdocs.yml").string(),
                                   Root().string()));
    ASSERT_EQ(end.exit_code, 0) << end.err;
    for (const auto& entry : fs::recursive_directory_iterator(Root())) {
      if (entry.path().extension() != ".html") continue;
      (*pages_)[entry.path().lexically_relative(Root()).string()] = ReadBytes(entry.path());
    }
  }
  static void TearDownTestSuite() {
    delete dir_;
    pages_->clear();
  }

  void SetUp() override {
    if (!HasMkDocs()) GTEST_SKIP() << "no mkdocs: apt-get install mkdocs";
    ASSERT_FALSE(pages_->empty());
  }

  static bool HasMkDocs() { return test::RunShell("command -v mkdocs").exit_code == 0; }
  static fs::path Root() { return dir_->path() / "site"; }
  // Path in the site -> HTML.
  static const std::map<std::string, std::string>& Pages() { return *pages_; }

  static test::TempDir* dir_;
  static std::map<std::string, std::string>* const pages_;
};
test::TempDir* Site::dir_ = nullptr;
std::map<std::string, std::string>* const Site::pages_ = new std::map<std::string, std::string>;

TEST_F(Site, HasEveryPageOfTheDocuments) {
  for (const auto& entry : fs::recursive_directory_iterator(test::SourceDir() / "docs")) {
    if (entry.path().extension() != ".md") continue;
    fs::path page = entry.path().lexically_relative(test::SourceDir());
    page.replace_extension(".html");
    EXPECT_TRUE(Pages().contains(page.string())) << page;
    // It is in the menu of the first page.
    EXPECT_THAT(Pages().at("index.html"), HasSubstr("href=\"" + page.string()));
  }
  // Neither code nor what a build leaves behind.
  EXPECT_FALSE(fs::exists(Root() / "build"));
  EXPECT_FALSE(fs::exists(Root() / "CMakeLists.txt"));
  EXPECT_FALSE(fs::exists(Root() / "docs/mkdocs.yml"));
}

TEST_F(Site, LinksLeadSomewhere) {
  std::map<std::string, std::set<std::string>> anchors;
  for (const auto& [page, html] : Pages()) {
    const auto ids = Captures(html, R"re(\s(?:id|name)="([^"]+)")re");
    anchors[page] = {ids.begin(), ids.end()};
  }
  std::vector<std::string> dead;
  for (const auto& [page, html] : Pages()) {
    if (page == "404.html") continue;  // for a server: its links begin at the root
    for (const std::string& link : Captures(html, R"re(\s(?:href|src)="([^"]*)")re")) {
      if (IsOfTheWeb(link) || link.starts_with("mailto:") || link == "#") continue;
      const std::size_t hash = link.find('#');
      const std::string path = link.substr(0, link.find_first_of("#?"));
      const std::string target =
          path.empty() ? page : (fs::path(page).parent_path() / path).lexically_normal().string();
      const bool lost_anchor = hash != std::string::npos && anchors.contains(target) &&
                               !anchors[target].contains(link.substr(hash + 1));
      if (!fs::exists(Root() / target) || lost_anchor)
        dead.push_back(fmt::format("{} -> {}", page, link));
    }
  }
  EXPECT_THAT(dead, IsEmpty());
}

TEST_F(Site, NeedsNoNetwork) {
  for (const auto& [page, html] : Pages()) {
    for (const char* loaded : {R"re(\ssrc="([^"]+)")re", R"re(<link [^>]*href="([^"]+)")re"}) {
      for (const std::string& target : Captures(html, loaded)) {
        EXPECT_FALSE(IsOfTheWeb(target)) << page << " loads " << target;
      }
    }
  }
  for (const auto& entry : fs::recursive_directory_iterator(Root())) {
    if (entry.path().extension() != ".css") continue;
    const std::string css = ReadBytes(entry.path());
    for (const std::string& target :
         Captures(css, R"re((?:url\(|@import )\s*['"]?([^'")\s]+))re")) {
      EXPECT_FALSE(IsOfTheWeb(target)) << entry.path() << " loads " << target;
    }
  }
}

// MkDocs wants an empty line before a list or a table where others need none.
TEST_F(Site, ShowsNoMarkdown) {
  for (const auto& [page, html] : Pages()) {
    for (std::size_t at = html.find("<p>"); at != std::string::npos;
         at = html.find("<p>", at + 1)) {
      const std::string paragraph = html.substr(at + 3, html.find("</p>", at) - at - 3);
      EXPECT_FALSE(
          std::regex_search(paragraph, std::regex(R"((^|\n)\s*([-*] |\d+\. |\||```|#+ ))")))
          << page << ": " << paragraph;
    }
    for (const std::string& code : Captures(html, R"re(<code>([^<]*)</code>)re")) {
      EXPECT_THAT(code, Not(HasSubstr("\\|"))) << page;
    }
  }
}

// Opens every page in a frame as wide as a phone.
constexpr const char* kPhone = R"(<!doctype html><body><script>
const pages = PAGES;
const results = {};
async function look(page) {
  const frame = document.createElement('iframe');
  frame.style = 'width: 390px; height: 800px; border: 0';
  const loaded = new Promise((done) => { frame.onload = done; });
  frame.src = page;
  document.body.append(frame);
  await loaded;
  const its = frame.contentDocument;
  results[page] = {
    wider: its.documentElement.scrollWidth - 390,
    text: its.querySelector('[role=main]').innerText.length,
    blank: [...its.images].filter((image) => !image.naturalWidth).map((image) => image.src),
    foreign: frame.contentWindow.performance.getEntriesByType('resource').map((r) => r.name)
        .filter((name) => !/^(file|data|blob):/.test(name)),
  };
  its.querySelector('[data-toggle="wy-nav-top"]').click();
  results[page].menu = its.querySelector('nav.wy-nav-side').getBoundingClientRect().left;
  frame.remove();
}
(async () => {
  for (const page of pages) await look(page);
  const out = document.createElement('pre');
  out.id = 'probe';
  out.textContent = JSON.stringify(results);
  document.body.append(out);
})();
</script>)";

TEST_F(Site, IsReadOnAPhone) {
  if (test::Browser().empty()) GTEST_SKIP() << "no chromium";
  std::vector<std::string> pages;
  for (const auto& [page, html] : Pages()) {
    if (page != "404.html") pages.push_back(page);
  }
  const std::string driver =
      std::regex_replace(kPhone, std::regex("PAGES"), nlohmann::json(pages).dump());
  WriteBytes(Root() / "phone.html", driver);
  const test::ProgramEnd end =
      test::Browse(Root() / "phone.html",
                   "--window-size=800,900 --allow-file-access-from-files --dump-dom",
                   dir_->path());
  const auto probe = test::Probe(end.out);
  ASSERT_TRUE(probe) << end.err;
  const auto results = nlohmann::json::parse(*probe);
  ASSERT_EQ(results.size(), pages.size());
  for (const auto& [page, seen] : results.items()) {
    EXPECT_LE(seen["wider"], 0) << page << " is wider than a phone";
    EXPECT_GT(seen["text"], 200) << page;
    EXPECT_GE(seen["menu"], 0) << page << ": a touch does not open the menu";
    EXPECT_EQ(seen["blank"].size(), 0u) << page << seen["blank"].dump();
    EXPECT_EQ(seen["foreign"].size(), 0u) << page << seen["foreign"].dump();
  }
}

}  // namespace
}  // namespace cohort
