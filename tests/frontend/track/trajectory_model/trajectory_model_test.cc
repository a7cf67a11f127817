// The probabilistic trajectory model on trajectories in closed form: points at several depths
// before a camera that shakes and moves sideways, under which image positions are exactly affine in
// 1/depth, or ahead, under which no affine model of rank 3 fits them.

#include "frontend/track/trajectory_model/trajectory_model.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "frontend/core/random_stream.h"
#include "frontend/core/statistics.h"

namespace cohort {
namespace {

constexpr Eigen::Index kFeatures = 120;

struct Scene {
  Eigen::Matrix2Xd rest{2, kFeatures};       // where a far point is seen in frame 0 [px]
  Eigen::VectorXd inverse_depth{kFeatures};  // 0.1 .. 1
  bool ahead = false;
};

Scene MakeScene(bool ahead = false) {
  RandomStream random(5, "test/trajectory_model/scene");
  Scene scene;
  scene.ahead = ahead;
  for (Eigen::Index f = 0; f < kFeatures; ++f) {
    scene.rest.col(f) = Eigen::Vector2d(random.Uniform(0, 640), random.Uniform(0, 480));
    scene.inverse_depth[f] = random.Uniform(0.1, 1.0);
  }
  return scene;
}

// Motion sideways by 6 px a frame at inverse depth 1, or ahead by 2 % of the depth there; and shake
// of the whole picture.
Eigen::Matrix2Xd At(const Scene& scene, double t) {
  Eigen::Matrix2Xd x = scene.rest;
  if (scene.ahead) {
    const Eigen::Vector2d center(320, 240);
    for (Eigen::Index f = 0; f < x.cols(); ++f) {
      x.col(f) = center + (x.col(f) - center) / (1.0 - 0.02 * t * scene.inverse_depth[f]);
    }
  } else {
    x.row(0) += (6.0 * t * scene.inverse_depth).transpose();
  }
  x.colwise() += Eigen::Vector2d(8.0 * std::sin(1.3 * t), 6.0 * std::cos(0.7 * t));
  return x;
}

constexpr std::size_t kFrames = 31;
constexpr int kMaxRank = 8;

using Observation = TrajectoryModel::Observation;

Observation Seen(const Eigen::Vector2d& xy, double sigma_px) {
  return {xy, Eigen::Matrix2d::Identity() / (sigma_px * sigma_px), false};
}

// Positions of frame t, measured with noise; every feature's anchor is as noisy as any picture.
class Measured {
 public:
  Measured(const Scene& scene, double noise_px)
      : scene_(scene), noise_px_(noise_px), anchor_error_(2, scene.rest.cols()) {
    for (Eigen::Index i = 0; i < anchor_error_.size(); ++i) {
      anchor_error_.data()[i] = noise_px * random_.Gaussian();
    }
  }
  std::vector<Observation> operator()(double t) {
    const Eigen::Matrix2Xd x = At(scene_, t) + anchor_error_;
    std::vector<Observation> now;
    for (Eigen::Index f = 0; f < x.cols(); ++f) {
      const Eigen::Vector2d noise(noise_px_ * random_.Gaussian(), noise_px_ * random_.Gaussian());
      now.push_back(Seen(x.col(f) + noise, std::max(noise_px_, 0.02)));
    }
    return now;
  }

 private:
  const Scene& scene_;
  double noise_px_;
  Eigen::Matrix2Xd anchor_error_;
  RandomStream random_{6, "test/trajectory_model/noise"};
};

// After frame 0, where all features are born.
TrajectoryModel Begun(const Scene& scene, int max_rank = kMaxRank, bool perspective = true) {
  TrajectoryModel model(kFrames, max_rank, perspective);
  model.Update({});
  const Eigen::Matrix2Xd x = At(scene, 0);
  for (Eigen::Index f = 0; f < x.cols(); ++f) {
    model.Add(x.col(f));
  }
  return model;
}

double RootMeanSquare(const std::vector<TrajectoryModel::Estimate>& estimates,
                      const Eigen::Matrix2Xd& truth) {
  double square = 0.0;
  for (std::size_t f = 0; f < estimates.size(); ++f) {
    square += (estimates[f].xy - truth.col(static_cast<Eigen::Index>(f))).squaredNorm();
  }
  return std::sqrt(square / (2.0 * static_cast<double>(estimates.size())));
}

TEST(TrajectoryModel, OfARigidSceneIsExactWithoutNoise) {
  for (const bool ahead : {false, true}) {
    const Scene scene = MakeScene(ahead);
    Measured measured(scene, 0.0);
    TrajectoryModel model = Begun(scene);
    for (int t = 1; t < 10; ++t) model.Update(measured(t));
    EXPECT_LT(RootMeanSquare(model.Predict(measured(10)), At(scene, 10)), 0.05);
    EXPECT_EQ(model.rank(), 3);  // two of the picture, one of depth
  }
}

// Perspective leaves the plane at infinity open: it must not wander into the scene.
TEST(TrajectoryModel, FollowsACameraThatTurnsAwayFromWhatItSawFirst) {
  RandomStream random(8, "test/trajectory_model/turn");
  std::vector<Eigen::Vector3d> points;
  TrajectoryModel model(kFrames, kMaxRank, true);
  model.Update({});
  const auto project = [](const Eigen::Vector3d& p) -> Eigen::Vector2d {
    return Eigen::Vector2d(320, 240) + 500.0 * p.head<2>() / p.z();
  };
  const auto is_seen = [&](const Eigen::Vector3d& p) {
    const Eigen::Vector2d xy = project(p);
    return p.z() > 1.0 && xy.x() > 0 && xy.x() < 640 && xy.y() > 0 && xy.y() < 480;
  };
  constexpr double kNoisePx = 1.0;
  const Eigen::AngleAxisd turn(0.02, Eigen::Vector3d::UnitY());
  for (int t = 0; t < 200; ++t) {
    std::vector<Observation> now;
    Eigen::Matrix2Xd truth(2, static_cast<Eigen::Index>(points.size()));
    for (std::size_t f = 0; f < points.size(); ++f) {
      points[f] = turn * points[f] - Eigen::Vector3d(0.1, 0.0, 0.05);
      truth.col(static_cast<Eigen::Index>(f)) = project(points[f]);
      const Eigen::Vector2d noise(random.Gaussian(), random.Gaussian());
      now.push_back(Seen(project(points[f]) + kNoisePx * noise, kNoisePx));
    }
    if (t > 0) {
      EXPECT_LT(RootMeanSquare(model.Update(now), truth), 2.0 * kNoisePx) << "in frame " << t;
    }
    std::vector<std::uint8_t> keep;
    for (const Eigen::Vector3d& p : points) keep.push_back(is_seen(p) ? 1 : 0);
    model.Keep(keep);
    std::erase_if(points, [&](const Eigen::Vector3d& p) { return !is_seen(p); });
    while (points.size() < 80) {
      const Eigen::Vector3d p(random.Uniform(-4, 4), random.Uniform(-3, 3), random.Uniform(2, 20));
      if (!is_seen(p)) continue;
      points.push_back(p);
      model.Add(project(p));
    }
  }
}

// As from a car: features come near within a few frames, and others follow. Alternation does not
// converge here, and full Gauss-Newton steps run away.
TEST(TrajectoryModel, PredictsWhatPassesACarToItsNoise) {
  RandomStream random(9, "test/trajectory_model/drive");
  struct Point {
    Eigen::Vector3d in_world;
    Eigen::Vector2d anchor_error;
    int born;
  };
  constexpr int kKnownAfter = 3;  // frames; before, nothing tells how far away a feature is
  constexpr double kNoisePx = 0.2;
  constexpr double kStep = 1.2;  // [m] a frame
  const auto noise = [&] {
    return Eigen::Vector2d(kNoisePx * random.Gaussian(), kNoisePx * random.Gaussian());
  };
  const auto at = [](const Point& p, int t) -> Eigen::Vector2d {
    const Eigen::Vector3d x = p.in_world - Eigen::Vector3d(0, 0, kStep * t);
    return Eigen::Vector2d(600, 180) + 700.0 * x.head<2>() / x.z() + p.anchor_error;
  };
  const auto is_seen = [&](const Point& p, int t) {
    const Eigen::Vector2d xy = at(p, t);
    return p.in_world.z() - kStep * t > 1.0 && xy.x() > 5 && xy.x() < 1195 && xy.y() > 5 &&
           xy.y() < 365;
  };
  std::vector<Point> points;
  TrajectoryModel model(kFrames, kMaxRank, true);
  model.Update({});
  for (int t = 0; t < 50; ++t) {
    if (t > 0) {
      std::vector<Observation> now;
      for (const Point& p : points) now.push_back(Seen(at(p, t) + noise(), kNoisePx));
      if (t > 5) {
        const auto predicted = model.Predict(now);
        ASSERT_EQ(predicted.size(), now.size());
        std::vector<double> distances;
        for (std::size_t f = 0; f < now.size(); ++f) {
          if (t - points[f].born < kKnownAfter) continue;
          distances.push_back((predicted[f].expected_xy - now[f].xy).norm());
        }
        EXPECT_LT(Median(distances), 3.0 * kNoisePx) << "in frame " << t;
        EXPECT_LT(Quantile(distances, 0.9), 6.0 * kNoisePx) << "in frame " << t;
      }
      model.Update(now);
      std::vector<std::uint8_t> keep;
      for (const Point& p : points) keep.push_back(is_seen(p, t) ? 1 : 0);
      model.Keep(keep);
      std::erase_if(points, [&](const Point& p) { return !is_seen(p, t); });
    }
    while (points.size() < 300) {  // along both sides of the road, and on it
      const double x = random.Uniform(-595, 595) / 700.0;
      const double y = random.Uniform(-175, 180) / 700.0;
      double z = std::min(150.0, random.Uniform(6, 9) / std::max(std::abs(x), 1e-6));
      if (y > 0.0) z = std::min(z, 1.65 / y);
      const Point p{z * Eigen::Vector3d(x, y, 1.0) + Eigen::Vector3d(0, 0, kStep * t), noise(), t};
      if (!is_seen(p, t)) continue;
      points.push_back(p);
      model.Add(at(p, t));
    }
  }
  EXPECT_LE(model.rank(), 4);
}

TEST(TrajectoryModel, WithoutPerspectiveDoesNotFitMotionAhead) {
  const Scene scene = MakeScene(true);
  Measured measured(scene, 0.0);
  TrajectoryModel affine = Begun(scene, 3, false);
  TrajectoryModel projective = Begun(scene, 3, true);
  for (int t = 1; t < 15; ++t) {
    affine.Update(measured(t));
    projective.Update(measured(t));
  }
  EXPECT_GT(RootMeanSquare(affine.Predict(measured(15)), At(scene, 15)), 1.0);
  EXPECT_LT(RootMeanSquare(projective.Predict(measured(15)), At(scene, 15)), 0.05);
}

TEST(TrajectoryModel, TakesNoNoiseForADimension) {
  for (const bool ahead : {false, true}) {
    const Scene scene = MakeScene(ahead);
    Measured measured(scene, 0.3);
    TrajectoryModel model = Begun(scene);
    for (int t = 1; t < 30; ++t) model.Update(measured(t));
    EXPECT_EQ(model.rank(), 3);
  }
}

TEST(TrajectoryModel, IsNearerToTheTruthThanTheMeasurementsAndKnowsHowNear) {
  const Scene scene = MakeScene();
  constexpr double kNoisePx = 0.5;
  Measured measured(scene, kNoisePx);
  TrajectoryModel model = Begun(scene);
  std::vector<TrajectoryModel::Estimate> fused;
  for (int t = 1; t <= 20; ++t) fused = model.Update(measured(t));
  const Eigen::Matrix2Xd truth = At(scene, 20);
  // Measured: the noise of the picture and of the anchor.
  EXPECT_LT(RootMeanSquare(fused, truth), 0.6 * std::sqrt(2.0) * kNoisePx);
  double normalised = 0.0;
  for (std::size_t f = 0; f < fused.size(); ++f) {
    const Eigen::Vector2d d = fused[f].xy - truth.col(static_cast<Eigen::Index>(f));
    normalised += d.dot(fused[f].covariance.inverse() * d) / 2.0;
  }
  normalised /= static_cast<double>(fused.size());
  EXPECT_GT(normalised, 0.5);
  EXPECT_LT(normalised, 2.5);
}

TEST(TrajectoryModel, TellsFeaturesThatGoTheirOwnWay) {
  const Scene scene = MakeScene();
  Measured measured(scene, 0.2);
  TrajectoryModel model = Begun(scene);
  for (int t = 1; t < 10; ++t) model.Update(measured(t));
  std::vector<Observation> now = measured(10);
  for (std::size_t f = 0; f < 30; ++f) now[f].xy += Eigen::Vector2d(7.0, -5.0);
  EXPECT_LT(RootMeanSquare(model.Predict(now), At(scene, 10)), 0.4);
}

TEST(TrajectoryModel, TellsFeaturesThatStrayMoreThanTheirNoise) {
  const Scene scene = MakeScene();
  Measured measured(scene, 0.3);
  TrajectoryModel model = Begun(scene);
  RandomStream random(7, "test/trajectory_model/stray");
  for (int t = 1; t < 20; ++t) {
    std::vector<Observation> now = measured(t);
    now[0].xy += Eigen::Vector2d(0.6 * random.Gaussian(), 0.6 * random.Gaussian());
    model.Update(now);
  }
  EXPECT_GT(model.Misfit(0), 2.0);
  double mean = 0.0;
  for (std::size_t f = 1; f < kFeatures; ++f) mean += model.Misfit(f) / (kFeatures - 1);
  EXPECT_NEAR(mean, 1.0, 0.2);
}

TEST(TrajectoryModel, NeedsEightFeatures) {
  const Scene scene = MakeScene();
  Measured measured(scene, 0.0);
  TrajectoryModel model = Begun(scene);
  std::vector<Observation> now = measured(1);
  std::fill(now.begin() + 7, now.end(), Observation{});
  EXPECT_TRUE(model.Predict(now).empty());
  now[7] = measured(1)[7];
  EXPECT_FALSE(model.Predict(now).empty());
}

TEST(TrajectoryModel, HoldsAHiddenFeatureByItsCourseBeforeThat) {
  const Scene scene = MakeScene();
  constexpr double kNoisePx = 0.3;
  constexpr std::size_t kHidden = 40;
  Measured measured(scene, kNoisePx);
  TrajectoryModel model = Begun(scene);
  for (int t = 1; t <= 20; ++t) {
    std::vector<Observation> now = measured(t);
    if (t >= 10) std::fill(now.begin(), now.begin() + kHidden, Observation{});
    const auto fused = model.Update(now);
    if (t != 10 && t != 15 && t != 20) continue;
    double square = 0.0;
    double expected = 0.0;
    for (std::size_t f = 0; f < kHidden; ++f) {
      square += (fused[f].xy - At(scene, t).col(static_cast<Eigen::Index>(f))).squaredNorm();
      expected += fused[f].covariance.trace();
    }
    EXPECT_LT(std::sqrt(square / kHidden), 3.0 * kNoisePx) << "frame " << t;
    EXPECT_LT(square, 2.5 * expected) << "the expected error is too small, frame " << t;
    EXPECT_GT(square, 0.3 * expected) << "the expected error is too large, frame " << t;
  }
}

TEST(TrajectoryModel, ANewFeatureFollowsTheOthersUntilItIsSeen) {
  const Scene scene = MakeScene();
  Measured measured(scene, 0.1);
  TrajectoryModel model = Begun(scene);
  for (int t = 1; t < 10; ++t) model.Update(measured(t));
  model.Add(At(scene, 9).col(0));
  std::vector<Observation> now = measured(10);
  now.emplace_back();
  const auto predicted = model.Predict(now);
  ASSERT_EQ(predicted.size(), static_cast<std::size_t>(kFeatures) + 1);
  // Its depth is not known yet: parallax is up to 6 px a frame.
  const Eigen::Vector2d error = predicted.back().xy - At(scene, 10).col(0);
  EXPECT_LT(error.norm(), 5.0);
  EXPECT_LT(error.dot(predicted.back().covariance.inverse() * error), 9.0);
}

TEST(TrajectoryModel, GrowsToWhatTwoBodiesNeed) {
  // The second half of the features moves on its own.
  const Scene scene = MakeScene();
  Measured measured(scene, 0.1);
  TrajectoryModel model = Begun(scene);
  const auto turn = [&](double t, std::size_t f) -> Eigen::Vector2d {
    const double y = scene.rest(1, static_cast<Eigen::Index>(f)) / 480.0;
    return {5.0 * t * y, -4.0 * std::sin(0.9 * t) * (1.0 - y)};
  };
  std::vector<TrajectoryModel::Estimate> fused;
  double square = 0.0;
  for (int t = 1; t <= 20; ++t) {
    std::vector<Observation> now = measured(t);
    for (std::size_t f = kFeatures / 2; f < kFeatures; ++f) now[f].xy += turn(t, f);
    fused = model.Update(now);
  }
  const Eigen::Matrix2Xd truth = At(scene, 20);
  for (std::size_t f = 0; f < kFeatures; ++f) {
    Eigen::Vector2d at = truth.col(static_cast<Eigen::Index>(f));
    if (f >= kFeatures / 2) at += turn(20, f);
    square += (fused[f].xy - at).squaredNorm();
  }
  EXPECT_GT(model.rank(), 3);
  EXPECT_LT(std::sqrt(square / kFeatures), 0.5);
}

// What comes to cover the scene is a rigid body too, which one more dimension would fit. As the
// tracker does, this gives the model what is within five deviations of its prediction.
TEST(TrajectoryModel, WhatHasJustComeIntoThePictureAddsNoDimension) {
  constexpr int kEnters = 12;
  constexpr Eigen::Index kOfBar = 60;
  for (const bool ahead : {false, true}) {
    const Scene scene = MakeScene(ahead);
    Measured measured(scene, 0.3);
    TrajectoryModel model = Begun(scene);
    for (int t = 1; t <= kEnters; ++t) model.Update(measured(t));
    ASSERT_EQ(model.rank(), 3);
    RandomStream random(9, "test/trajectory_model/bar");
    Eigen::Matrix2Xd bar(2, kOfBar);
    for (Eigen::Index f = 0; f < kOfBar; ++f) {
      bar.col(f) = Eigen::Vector2d(random.Uniform(60, 140), random.Uniform(0, 480));
      model.Add(bar.col(f));
    }
    Eigen::Index believed = 0;  // of the bar, in the newest frame
    for (int t = kEnters + 1; t <= kEnters + 6; ++t) {
      std::vector<Observation> now = measured(t);
      for (Eigen::Index f = 0; f < kOfBar; ++f) {
        const Eigen::Vector2d noise(0.3 * random.Gaussian(), 0.3 * random.Gaussian());
        now.push_back(Seen(bar.col(f) + Eigen::Vector2d(6.0 * (t - kEnters), 0.0) + noise, 0.3));
      }
      const std::vector<TrajectoryModel::Estimate> predicted = model.Predict(now);
      believed = 0;
      for (std::size_t f = kFeatures; f < now.size(); ++f) {
        const Eigen::Vector2d d = now[f].xy - predicted[f].expected_xy;
        const Eigen::Matrix2d S =
            predicted[f].measured_covariance + 0.09 * Eigen::Matrix2d::Identity();
        if (d.dot(S.inverse() * d) <= 25.0) {
          ++believed;
        } else {
          now[f] = {};
        }
      }
      model.Update(now);
      EXPECT_EQ(model.rank(), 3) << "ahead: " << ahead << ", " << t - kEnters << " frames after";
    }
    EXPECT_LT(believed, kOfBar / 4) << "ahead: " << ahead;
  }
}

}  // namespace
}  // namespace cohort
