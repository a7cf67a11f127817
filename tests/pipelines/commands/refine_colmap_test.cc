// `cohort refine` of what the real COLMAP made by SIFT, and COLMAP's own tools on what comes back.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "backend/colmap/model_io.h"
#include "backend/colmap/program.h"
#include "tests/support/program.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using testing::HasSubstr;

class RefineColmap : public testing::Test {
 protected:
  std::string path(const std::string& name) const { return dir_ / name; }
  void Run(const std::string& line) {
    const test::ProgramEnd end = test::RunShell(line);
    ASSERT_EQ(end.exit_code, 0) << line << "\n" << end.out << end.err;
  }
  // Share of the cameras' path.
  double Error(const std::string& model) {
    const test::ProgramEnd end = test::RunCohort("evaluate " + path(model) + " --quiet --truth " +
                                                 path("clip") + " --json " + path("e.json"));
    EXPECT_EQ(end.exit_code, 0) << end.err;
    return nlohmann::json::parse(ReadBytes(path("e.json")))["ate_share"].get<double>();
  }

  test::TempDir dir_;
};

// As somebody would who has never heard of tracks: COLMAP finds the camera itself.
TEST_F(RefineColmap, AModelOfSiftHasLessErrorAfterwardsAndColmapReadsIt) {
  constexpr const char* kQuiet = " > /dev/null 2>&1";
  Run(test::ProgramPath() + " synth " + path("clip") +
      " --width-px 320 --height-px 240 --focal-px 260 "
      "--frames 20 --quiet");
  Run(test::ProgramPath() + " degrade " + path("clip") + " " + path("dark") +
      " --level 0.5 --quiet");
  const std::string images = " --image_path " + path("dark/rgb");
  const std::string database = " --database_path " + path("db.db");
  const bool is_old =
      ColmapProgram().Options("feature_extractor").contains("SiftExtraction.use_gpu");
  const std::string extraction = is_old ? " --SiftExtraction" : " --FeatureExtraction";
  const std::string matching = is_old ? " --SiftMatching" : " --FeatureMatching";
  Run("colmap feature_extractor" + database + images + " --ImageReader.single_camera 1" +
      extraction + ".use_gpu 0" + extraction + ".num_threads 2" +
      " --SiftExtraction.peak_threshold 0.002" + kQuiet);
  Run("colmap exhaustive_matcher" + database + matching + ".use_gpu 0" + matching +
      ".num_threads 2" + kQuiet);
  Run("mkdir " + path("sparse"));
  Run("colmap mapper" + database + images + " --output_path " + path("sparse") +
      " --Mapper.init_min_tri_angle 4 --Mapper.num_threads 2" + kQuiet);

  // Newer ones give up on their first start, and keep that model of two images, too.
  const auto made = ReadLargestColmapModel(path("sparse"));
  ASSERT_TRUE(made);
  const ColmapModel& before = made->model;
  Run(test::ProgramPath() + " refine --quiet --model " + made->folder.string() + " --images " +
      path("dark") + " --out " + path("refined"));
  const ColmapModel after = ReadColmapModel(path("refined"));
  EXPECT_EQ(after.images.size(), before.images.size());
  for (const auto& [id, point] : after.points) {
    ASSERT_TRUE(before.points.contains(id));
    EXPECT_EQ(point.rgb, before.points.at(id).rgb);
  }
  EXPECT_LT(Error("refined"), 0.5 * Error("sparse/" + made->folder.filename().string()));

  const test::ProgramEnd analysis =
      test::RunShell("colmap model_analyzer --path " + path("refined") + " 2>&1");
  EXPECT_EQ(analysis.exit_code, 0) << analysis.out;
  EXPECT_THAT(analysis.out, HasSubstr("Registered images: " + std::to_string(after.images.size())));
  Run("mkdir " + path("undistorted"));
  Run("colmap image_undistorter" + images + " --input_path " + path("refined") + " --output_path " +
      path("undistorted") + kQuiet);
}

}  // namespace
}  // namespace cohort
