#include "backend/scene/bal.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tests/support/bal_errors.h"
#include "tests/support/cameras.h"
#include "tests/support/synthetic_tracks.h"
#include "tests/support/temp_dir.h"
#include "tests/support/zoom.h"

namespace cohort {
namespace {

TEST(Bal, ObservationsAreWhereTheFormatProjectsThePoints) {
  const test::TempDir dir;
  Camera radial = test::SyntheticTracksOptions::DefaultCamera();
  radial.k1 = -0.1;
  radial.k2 = 0.02;
  Camera tangential = radial;
  tangential.p1 = 0.001;
  Camera sixth_order = radial;
  sixth_order.k3 = 0.03;
  for (const Camera& camera :
       {radial, tangential, sixth_order, test::RationalCamera(), test::FisheyeCamera()}) {
    test::SyntheticTracksOptions options;
    options.noise_px = 0.0;
    options.camera = camera;
    const Reconstruction model = test::ModelOfTruth(test::MakeSyntheticTracks(options));
    WriteBal(dir / "problem.txt", model);
    const std::vector<double> errors = test::BalErrors(dir / "problem.txt");
    EXPECT_LT(*std::max_element(errors.begin(), errors.end()), 1e-9);
    EXPECT_GT(errors.size(), 1000u);
  }
}

TEST(Bal, EveryCameraOfAZoomHasItsOwnFocalLength) {
  const test::TempDir dir;
  Camera radial = test::SyntheticTracksOptions::DefaultCamera();
  radial.k1 = -0.1;
  for (const Camera& camera : {radial, test::FisheyeCamera()}) {
    test::SyntheticTracksOptions options;
    options.noise_px = 0.0;
    options.camera = camera;
    const test::SyntheticTracks scene = test::MakeSyntheticTracks(options);
    const FocalScales scales = test::ZoomOf(scene.file.frames);
    WriteBal(dir / "problem.txt", test::ModelOfTruth(test::Zoomed(scene, scales), scales));
    const std::vector<double> errors = test::BalErrors(dir / "problem.txt");
    EXPECT_LT(*std::max_element(errors.begin(), errors.end()), 1e-9);
  }
}

}  // namespace
}  // namespace cohort
