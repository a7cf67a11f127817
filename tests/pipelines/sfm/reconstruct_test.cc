#include "pipelines/sfm/reconstruct.h"

#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "backend/colmap/model_io.h"
#include "frontend/storage/output.h"
#include "pipelines/sfm/summary_json.h"
#include "tests/support/synthetic_tracks.h"
#include "tests/support/temp_dir.h"
#include "tests/support/zoom.h"

namespace cohort {
namespace {

Reconstruction ModelOfAZoom() {
  const test::SyntheticTracks scene = test::MakeSyntheticTracks({.frames = 5, .points = 20});
  const FocalScales scales = test::ZoomOf(scene.file.frames);
  return test::ModelOfTruth(test::Zoomed(scene, scales), scales);
}

TEST(ModelFolder, KeepsTheFocalLengthsOfAZoom) {
  const test::TempDir dir;
  const Reconstruction model = ModelOfAZoom();
  WriteModelFolder(model, "{}", dir / "model");
  const Reconstruction read = ReadModelFolder(dir / "model");
  EXPECT_EQ(read.focal_scale.size(), 5u);
  for (const auto& [frame, pose] : model.cam_from_world) {
    EXPECT_NEAR(CameraOf(read, frame).fx, CameraOf(model, frame).fx, 1e-9);
  }
}

// A refined model has the ids of the one that came in: here of the frames in the other order.
TEST(ModelFolder, FocalLengthsAreThoseOfTheFramesThatTheSummaryHas) {
  const test::TempDir dir;
  const Reconstruction model = ModelOfAZoom();
  nlohmann::ordered_json summary;
  for (std::uint32_t i = 0; i < 5; ++i) summary["frame_of_image"].push_back({i + 1, 14 - i});
  WriteReconstruction(dir / "model", model);
  WriteBytes(dir / "model" / "summary.json", summary.dump());
  const Reconstruction read = ReadModelFolder(dir / "model");
  for (std::uint32_t i = 0; i < 5; ++i) {
    EXPECT_NEAR(CameraOf(read, FrameIndex{14 - i}).fx, CameraOf(model, FrameIndex{i}).fx, 1e-9);
  }
}

TEST(SummaryJson, HasTheShortestAndTheLongestFocalLengthOfAZoom) {
  ReconstructResult result;
  result.reconstruction = ModelOfAZoom();
  const auto json = SummaryToJson(result, {}, {});
  const double focal_px = result.reconstruction.camera.fx;
  EXPECT_NEAR(json["focal_lengths_px"]["min"].get<double>(), focal_px / std::sqrt(2.0), 1e-9);
  EXPECT_NEAR(json["focal_lengths_px"]["max"].get<double>(), focal_px * std::sqrt(2.0), 1e-9);
  result.reconstruction.focal_scale.clear();
  EXPECT_FALSE(SummaryToJson(result, {}, {}).contains("focal_lengths_px"));
}

}  // namespace
}  // namespace cohort
