// Strangers' projects find the installed libraries, or have the sources below them, and build the
// program that the README shows.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "backend/colmap/model_io.h"
#include "datasets/render/synthetic_scene.h"
#include "frontend/storage/output.h"
#include "frontend/tracks/track_store.h"
#include "tests/support/shell.h"
#include "tests/support/source_dir.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

class Install : public testing::Test {
 protected:
  std::string Path(const std::string& name) const { return dir_ / name; }

  static std::string SourceDir() { return test::SourceDir().string(); }

  void InstallIntoPrefix() const {
    const test::ProgramEnd end = test::RunShell(fmt::format("'{}' --install '{}' --prefix '{}'",
                                                            COHORT_CMAKE,
                                                            test::BuildDir().string(),
                                                            Path("prefix")));
    ASSERT_EQ(end.exit_code, 0) << end.err;
  }

  // Configures one of the projects beside this file into `build`.
  test::ProgramEnd Configure(const std::string& project, const std::string& more) const {
    return test::RunShell(
        fmt::format("'{}' -S '{}/tests/install/{}' -B '{}' -G '{}' -DCMAKE_CXX_COMPILER='{}' "
                    "-DCMAKE_CXX_FLAGS='{}' -DCMAKE_BUILD_TYPE=Release {}",
                    COHORT_CMAKE,
                    SourceDir(),
                    project,
                    Path("build"),
                    COHORT_GENERATOR,
                    COHORT_COMPILER,
                    COHORT_SANITIZE_FLAGS,
                    more));
  }

  test::TempDir dir_;
};

TEST_F(Install, AProjectThatFindsThePackageBuildsAndReconstructsAVideo) {
  ASSERT_NO_FATAL_FAILURE(InstallIntoPrefix());
  const test::ProgramEnd configured =
      Configure("installed", fmt::format("-DCMAKE_PREFIX_PATH='{}'", Path("prefix")));
  ASSERT_EQ(configured.exit_code, 0) << configured.err;
  const test::ProgramEnd built =
      test::RunShell(fmt::format("'{}' --build '{}'", COHORT_CMAKE, Path("build")));
  ASSERT_EQ(built.exit_code, 0) << built.out;

  SyntheticSceneOptions scene;
  scene.frames = 20;
  scene.width_px = 320;
  scene.height_px = 240;
  scene.focal_px = 260.0;
  RenderSequence(scene, Path("clip"));
  const test::ProgramEnd end = test::RunShell(
      fmt::format("'{}' '{}' '{}'", Path("build/example"), Path("clip"), Path("model")));
  EXPECT_EQ(end.exit_code, 0) << end.err;
  EXPECT_THAT(end.out, HasSubstr("20 of 20 frames"));
  EXPECT_EQ(ReadReconstruction(Path("model")).cam_from_world.size(), 20u);
  EXPECT_EQ(ReadTrackFile(Path("model.tracks")).frames.size(), 20u);
}

TEST_F(Install, BringsTheManualAndTheCompletions) {
  if (!fs::exists(test::BuildDir() / "manual")) GTEST_SKIP() << "no program was built";
  ASSERT_NO_FATAL_FAILURE(InstallIntoPrefix());
  for (const char* file : {"man/man1/cohort.1",
                           "man/man1/cohort-track.1",
                           "bash-completion/completions/cohort",
                           "zsh/site-functions/_cohort",
                           "fish/vendor_completions.d/cohort.fish"}) {
    EXPECT_TRUE(fs::exists(Path(std::string("prefix/share/") + file))) << file;
  }
}

// Nothing of this machine or of the build stands in what is installed.
TEST_F(Install, ThePackageCanBeMoved) {
  ASSERT_NO_FATAL_FAILURE(InstallIntoPrefix());
  int files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(Path("prefix"))) {
    if (entry.path().extension() != ".cmake") continue;
    const std::string text = ReadBytes(entry.path());
    EXPECT_THAT(text, Not(HasSubstr(SourceDir()))) << entry.path();
    EXPECT_THAT(text, Not(HasSubstr(Path("prefix")))) << entry.path();
    EXPECT_THAT(text, Not(HasSubstr("/usr/include"))) << entry.path();
    ++files;
  }
  EXPECT_GE(files, 4);
}

TEST_F(Install, AnUnknownComponentIsNotFound) {
  ASSERT_NO_FATAL_FAILURE(InstallIntoPrefix());
  WriteBytes(Path("CMakeLists.txt"),
             "cmake_minimum_required(VERSION 3.25)\nproject(asks LANGUAGES CXX)\n"
             "find_package(cohort REQUIRED COMPONENTS colour)\n");
  const test::ProgramEnd end =
      test::RunShell(fmt::format("'{}' -S '{}' -B '{}' -DCMAKE_PREFIX_PATH='{}'",
                                 COHORT_CMAKE,
                                 dir_.path().string(),
                                 Path("build"),
                                 Path("prefix")));
  EXPECT_NE(end.exit_code, 0);
  EXPECT_THAT(end.err, HasSubstr("colour"));
}

TEST_F(Install, EveryComponentIsFoundByItself) {
  ASSERT_NO_FATAL_FAILURE(InstallIntoPrefix());
  for (const std::string component : {"frontend", "backend", "datasets", "sfm"}) {
    fs::create_directory(Path(component));
    WriteBytes(Path(component + "/CMakeLists.txt"),
               fmt::format("cmake_minimum_required(VERSION 3.25)\nproject(asks LANGUAGES CXX)\n"
                           "find_package(cohort REQUIRED COMPONENTS {0})\n"
                           "file(WRITE main.cc \"int main() {{}}\")\n"
                           "add_executable(asks main.cc)\n"
                           "target_link_libraries(asks PRIVATE cohort::{0})\n",
                           component));
    const test::ProgramEnd end =
        test::RunShell(fmt::format("'{}' -S '{}' -B '{}' -DCMAKE_PREFIX_PATH='{}'",
                                   COHORT_CMAKE,
                                   Path(component),
                                   Path(component + "/build"),
                                   Path("prefix")));
    EXPECT_EQ(end.exit_code, 0) << end.err;
  }
}

// Who asks whether it is there goes on where what it needs is missing.
TEST_F(Install, IsNotFoundWhereALibraryIsMissing) {
  ASSERT_NO_FATAL_FAILURE(InstallIntoPrefix());
  WriteBytes(Path("CMakeLists.txt"),
             "cmake_minimum_required(VERSION 3.25)\nproject(asks LANGUAGES CXX)\n"
             "find_package(cohort)\nif(cohort_FOUND)\n"
             "message(STATUS \"it is there\")\nendif()\n");
  const test::ProgramEnd end = test::RunShell(
      fmt::format("PKG_CONFIG_LIBDIR=/nowhere '{}' -S '{}' -B '{}' -DCMAKE_PREFIX_PATH='{}'",
                  COHORT_CMAKE,
                  dir_.path().string(),
                  Path("build"),
                  Path("prefix")));
  EXPECT_EQ(end.exit_code, 0) << end.err;
  EXPECT_THAT(end.out, Not(HasSubstr("it is there")));
  EXPECT_THAT(end.err, HasSubstr("cohort needs libzip"));
}

// Without what only the program and the tests need: a project below another builds neither.
TEST_F(Install, ASubprojectIsTheLibrariesAlone) {
  const test::ProgramEnd configured =
      Configure("subproject",
                fmt::format("-DCOHORT_SOURCE_DIR='{}' -DCMAKE_DISABLE_FIND_PACKAGE_CLI11=ON "
                            "-DCMAKE_DISABLE_FIND_PACKAGE_GTest=ON",
                            SourceDir()));
  ASSERT_EQ(configured.exit_code, 0) << configured.err;
  const std::string cache = ReadBytes(Path("build/CMakeCache.txt"));
  EXPECT_THAT(cache, HasSubstr("COHORT_BUILD_TESTS:BOOL=OFF"));
  for (const char* name : {"NODE_PROGRAM", "NPM_PROGRAM", "CCACHE_PROGRAM"}) {
    EXPECT_THAT(cache, Not(HasSubstr(name)));
  }
  const test::ProgramEnd targets =
      test::RunShell(fmt::format("'{}' --build '{}' --target help", COHORT_CMAKE, Path("build")));
  EXPECT_THAT(targets.out, HasSubstr("cohort_sfm"));
  for (const char* name : {"_test", "cohort_console", "report_page"}) {
    EXPECT_THAT(targets.out, Not(HasSubstr(name)));
  }
}

TEST(Readme, ShowsTheProgramThatIsBuiltHere) {
  const std::string readme = ReadBytes(test::SourceDir() / "README.md");
  const std::string program = ReadBytes(test::SourceDir() / "tests/install/main.cc");
  EXPECT_THAT(readme, HasSubstr("```cpp\n" + program + "```\n"));
}

}  // namespace
}  // namespace cohort
