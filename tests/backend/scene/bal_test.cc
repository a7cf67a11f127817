#include "backend/scene/bal.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <fstream>
#include <vector>

#include "tests/support/cameras.h"
#include "tests/support/synthetic_tracks.h"
#include "tests/support/temp_dir.h"

namespace cohort {
namespace {

// The truth of a scene as a model.
Reconstruction TrueModel(const test::SyntheticTracks& scene) {
  Reconstruction model;
  model.camera = *scene.file.camera;
  model.cam_from_world = scene.cam_from_world;
  for (const Observation& o : scene.file.tracks.observations()) {
    Point3D& point = model.points[o.feature];
    point.in_world = scene.points_in_world.at(o.feature);
    point.views.push_back({o.frame, o.xy});
  }
  return model;
}

// Reads a problem by the published format, and returns its largest reprojection error [px].
double LargestError(const std::string& path, std::size_t* observation_count) {
  std::ifstream in(path);
  std::size_t cameras = 0;
  std::size_t points = 0;
  std::size_t observations = 0;
  in >> cameras >> points >> observations;
  *observation_count = observations;
  struct Row {
    std::size_t camera, point;
    double x, y;
  };
  std::vector<Row> rows(observations);
  for (Row& row : rows) in >> row.camera >> row.point >> row.x >> row.y;
  std::vector<double> parameters(9 * cameras + 3 * points);
  for (double& value : parameters) in >> value;
  EXPECT_TRUE(in.good() || in.eof());
  double largest = 0.0;
  for (const Row& row : rows) {
    const double* c = parameters.data() + 9 * row.camera;
    const Eigen::Vector3d r(c[0], c[1], c[2]);
    const Eigen::Vector3d X(parameters.data() + 9 * cameras + 3 * row.point);
    const Eigen::Vector3d P =
        Eigen::AngleAxisd(r.norm(), r.normalized()) * X + Eigen::Vector3d(c[3], c[4], c[5]);
    EXPECT_LT(P.z(), 0.0);
    const Eigen::Vector2d p = -P.head<2>() / P.z();
    const double r2 = p.squaredNorm();
    const Eigen::Vector2d xy = c[6] * (1 + c[7] * r2 + c[8] * r2 * r2) * p;
    largest = std::max(largest, (xy - Eigen::Vector2d(row.x, row.y)).norm());
  }
  return largest;
}

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
    const Reconstruction model = TrueModel(test::MakeSyntheticTracks(options));
    WriteBal(dir / "problem.txt", model);
    std::size_t observations = 0;
    EXPECT_LT(LargestError(dir / "problem.txt", &observations), 1e-9);
    EXPECT_GT(observations, 1000u);
  }
}

}  // namespace
}  // namespace cohort
