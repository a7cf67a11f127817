#include "pipelines/experiment/undegraded.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "backend/colmap/model_io.h"
#include "frontend/storage/output.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

using test::TempDir;

Eigen::Vector3d TrueCentre(int place) {
  return {0.1 * place, 0.05 * std::sin(place), 0.02 * place * place / 10.0};
}

// Cameras at these centres, in a world `scale` times as large; frames first, first + stride, ...
template <typename Centre>
std::string WriteModel(const std::string& folder,
                       int first,
                       int stride,
                       double scale,
                       bool failed,
                       const Centre& centre) {
  Reconstruction model;
  model.camera = Camera::Guess(640, 480);
  for (int place = 0; place < 12; ++place) {
    const FrameIndex frame{static_cast<std::uint32_t>(first + stride * place)};
    model.cam_from_world[frame] = {Eigen::Quaterniond::Identity(), -scale * centre(place)};
    model.frame_names[frame] = fmt::format("{}.png", place);
    model.timestamps_ns[frame] = place;
  }
  WriteReconstruction(folder, model);
  WriteBytes(folder + "/summary.json",
             fmt::format("{{\"failed\": {}, \"frame_range\": \"{}:{}:{}\"}}",
                         failed,
                         first,
                         first + stride * 11 + 1,
                         stride));
  return folder;
}

class Undegraded : public testing::Test {
 protected:
  void SetUp() override {
    for (int place = 0; place < 12; ++place) {
      truth_[FrameIndex(100U + 2U * place)] = {Eigen::Quaterniond::Identity(), -TrueCentre(place)};
      // What the stride leaves out is somewhere else.
      truth_[FrameIndex(101U + 2U * place)] = {Eigen::Quaterniond::Identity(),
                                               -3.0 * TrueCentre(place)};
    }
    light_ = WriteModel(dir_ / "light", 100, 2, 7.0, false, TrueCentre);
  }

  TempDir dir_;
  std::map<FrameIndex, Rigid3> truth_;
  std::string light_;
};

TEST_F(Undegraded, FramesArePairedByTheirPlaceAndScalesDoNotMatter) {
  const std::string dark = WriteModel(dir_ / "dark", 0, 1, 0.3, false, TrueCentre);
  const auto error = ErrorToUndegraded(dark, light_, truth_);
  ASSERT_TRUE(error);
  EXPECT_NEAR(*error, 0.0, 1e-9);
}

TEST_F(Undegraded, TheErrorIsInMetresOfTheTruth) {
  // 1 cm up and down in turns, which no similarity takes away.
  const auto shaken = [](int place) -> Eigen::Vector3d {
    return TrueCentre(place) + Eigen::Vector3d(0.0, 0.0, place % 2 == 0 ? 0.01 : -0.01);
  };
  const std::string dark = WriteModel(dir_ / "dark", 0, 1, 0.3, false, shaken);
  const auto error = ErrorToUndegraded(dark, light_, truth_);
  ASSERT_TRUE(error);
  EXPECT_NEAR(*error, 0.01, 0.001);
}

TEST_F(Undegraded, AFailedOrMissingModelHasNone) {
  const std::string dark = WriteModel(dir_ / "dark", 0, 1, 0.3, true, TrueCentre);
  EXPECT_FALSE(ErrorToUndegraded(dark, light_, truth_));
  EXPECT_FALSE(ErrorToUndegraded(dir_ / "none", light_, truth_));
}

}  // namespace
}  // namespace cohort
