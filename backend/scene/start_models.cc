#include "backend/scene/start_models.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>

#include "backend/scene/affine_factorization.h"
#include "backend/scene/two_view_geometry.h"

namespace cohort {
namespace {

constexpr int kWindowFrames = 8;
constexpr double kMinExplained = 0.5;  // share of the window's observations

std::vector<int> WindowFrames(const WhitenedTracks& whitened, const FramePairMotion& pair) {
  std::vector<int> usable;
  for (int f = pair.frame_a; f <= pair.frame_b; ++f) {
    if (f == pair.frame_a || f == pair.frame_b ||
        2 * static_cast<int>(whitened.ObservationsIn(f).size()) >= pair.common) {
      usable.push_back(f);
    }
  }
  const int count = std::min(kWindowFrames, static_cast<int>(usable.size()));
  std::vector<int> window;
  for (int i = 0; i < count; ++i) {
    window.push_back(usable[i * (static_cast<int>(usable.size()) - 1) / (count - 1)]);
  }
  return window;
}

std::vector<int> TracksIn(const WhitenedTracks& whitened, const std::vector<int>& frames) {
  std::vector<int> tracks;
  for (const int f : frames) {
    for (const int o : whitened.ObservationsIn(f))
      tracks.push_back(whitened.observations()[o].track);
  }
  std::sort(tracks.begin(), tracks.end());
  tracks.erase(std::unique(tracks.begin(), tracks.end()), tracks.end());
  return tracks;
}

class WindowBuilder {
 public:
  WindowBuilder(const WhitenedTracks& whitened,
                const FramePairMotion& pair,
                const StartOptions& options)
      : whitened_(whitened),
        pair_(pair),
        options_(options),
        window_(WindowFrames(whitened, pair)),
        tracks_(TracksIn(whitened, window_)) {}

  void AddRelativePoses(const Camera& camera, std::vector<StartModel>& models) const {
    std::vector<Eigen::Vector2d> xy_a;
    std::vector<Eigen::Vector2d> xy_b;
    for (const auto& [a, b] : whitened_.CommonObservations(pair_.frame_a, pair_.frame_b)) {
      xy_a.push_back(whitened_.observations()[a].xy);
      xy_b.push_back(whitened_.observations()[b].xy);
    }
    Camera calibrated = camera;
    calibrated.known = true;  // this focal length is the hypothesis
    TwoViewOptions two_view;
    two_view.min_inliers = 8;
    const TwoViewGeometry geometry = EstimateTwoViewGeometry(xy_a, xy_b, calibrated, two_view);
    const auto add = [&](const Rigid3& pose, StartMethod method) {
      WorkingModel model(whitened_, camera, options_.model);
      model.SetPose(pair_.frame_a, {});
      model.SetPose(pair_.frame_b, pose);
      model.TriangulateTracks(tracks_);
      Finish(std::move(model), method, models);
    };
    if (geometry.cam2_from_cam1) add(*geometry.cam2_from_cam1, StartMethod::kEssential);
    constexpr double kNearlyPlanar = 0.6;
    if (geometry.homography && (geometry.homography_ratio > kNearlyPlanar)) {
      for (const Rigid3& pose : Decompose(*geometry.homography, camera)) {
        add(pose, StartMethod::kHomography);
      }
    }
  }

  void AddAffine(const Camera& camera, std::vector<StartModel>& models) const {
    WorkingModel start(whitened_, camera, options_.model);
    std::vector<AffineMeasurement> measurements;
    std::vector<int> number(whitened_.track_count(), -1);
    for (std::size_t i = 0; i < tracks_.size(); ++i) number[tracks_[i]] = static_cast<int>(i);
    for (std::size_t i = 0; i < window_.size(); ++i) {
      for (const int o : whitened_.ObservationsIn(window_[i])) {
        measurements.push_back(
            {static_cast<int>(i), number[whitened_.observations()[o].track], start.Normalised(o)});
      }
    }
    const auto affine = FactorizeAffine(
        static_cast<int>(window_.size()), static_cast<int>(tracks_.size()), measurements);
    if (!affine) return;
    for (const AffineModel& side : affine->mirror_models) {
      WorkingModel model(whitened_, camera, options_.model);
      for (std::size_t i = 0; i < window_.size(); ++i) {
        model.SetPose(window_[i], side.cam_from_world[i]);
      }
      // The factorisation's own points: rays of affine poses need not meet under perspective.
      for (std::size_t i = 0; i < tracks_.size(); ++i) {
        model.SetPoint(tracks_[i], side.points_in_world[i]);
      }
      // Generous: the bundle adjustment is to bring them in.
      constexpr double kAffineErrorFactor = 10.0;
      model.UpdateInliers(tracks_, std::numeric_limits<double>::infinity(), kAffineErrorFactor);
      Finish(std::move(model), StartMethod::kAffine, models);
    }
  }

 private:
  static std::vector<Rigid3> Decompose(const Eigen::Matrix3d& homography, const Camera& camera) {
    cv::Mat H;
    cv::eigen2cv(homography, H);
    const cv::Mat K =
        (cv::Mat_<double>(3, 3) << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
    std::vector<cv::Mat> rotations;
    std::vector<cv::Mat> translations;
    std::vector<cv::Mat> normals;
    const int count = cv::decomposeHomographyMat(H, K, rotations, translations, normals);
    std::vector<Rigid3> poses;
    for (int i = 0; i < count; ++i) {
      Eigen::Matrix3d rotation;
      Eigen::Vector3d translation;
      cv::cv2eigen(rotations[i], rotation);
      cv::cv2eigen(translations[i], translation);
      if (translation.norm() < 1e-9) continue;
      poses.push_back({Eigen::Quaterniond(rotation).normalized(), translation.normalized()});
    }
    return poses;
  }

  BundleOptions Bundle(const WorkingModel& model, int max_iterations) const {
    BundleOptions bundle;
    bundle.loss = RobustLoss::kCauchy;
    bundle.loss_scale = std::max(0.1, model.loss_turn());
    bundle.max_iterations = max_iterations;
    bundle.function_tolerance = 1e-4;
    bundle.refine_focal = options_.refine_focal;
    return bundle;
  }

  // Grows a first model over the window and adjusts it.
  void Finish(WorkingModel model, StartMethod method, std::vector<StartModel>& models) const {
    if (static_cast<int>(model.CountPoints()) < options_.min_points) return;
    const auto registered = [&] { return model.RegisteredFrames(); };
    model.Normalise();
    model.Adjust(registered(), {}, Bundle(model, 20));
    std::optional<Rigid3> start;
    for (const int f : window_) {
      if (!model.HasPose(f)) model.RegisterFrame(f, start);
      if (model.HasPose(f)) start = model.Pose(f);
    }
    for (int round = 0; round < 2; ++round) {
      model.TriangulateTracks(tracks_);
      model.UpdateAllInliers(std::numeric_limits<double>::infinity());
      model.Adjust(registered(), {}, Bundle(model, 20));
      model.UpdateAllInliers(std::numeric_limits<double>::infinity());
      if (static_cast<int>(model.CountPoints()) < options_.min_points) return;
    }
    int seen = 0;
    int explained = 0;
    for (const int f : window_) {
      for (const int o : whitened_.ObservationsIn(f)) {
        if (!model.HasPoint(whitened_.observations()[o].track)) continue;
        ++seen;
        if (model.IsInlier(o)) ++explained;
      }
    }
    if (explained < kMinExplained * seen) return;
    if (2 * registered().size() < window_.size()) return;
    model.Normalise();
    models.push_back({std::move(model), method, 0.0, window_});
  }

  const WhitenedTracks& whitened_;
  FramePairMotion pair_;
  StartOptions options_;
  std::vector<int> window_;
  std::vector<int> tracks_;
};

}  // namespace

std::vector<StartModel> BuildStartModels(const WhitenedTracks& whitened,
                                         const Camera& camera,
                                         const FramePairMotion& pair,
                                         const StartOptions& options) {
  const WindowBuilder builder(whitened, pair, options);
  std::vector<StartModel> models;
  std::vector<double> focal_factors{1.0};
  if (options.refine_focal) focal_factors = {1.0, 0.7, 1.4, 0.5, 2.0};
  for (const double factor : focal_factors) {
    Camera candidate = camera;
    candidate.fx *= factor;
    candidate.fy *= factor;
    builder.AddRelativePoses(candidate, models);
    builder.AddAffine(candidate, models);
  }
  double bound = options.model.max_reprojection_px;
  for (const StartModel& m : models) bound = std::min(bound, m.model.ErrorBound());
  for (StartModel& m : models) m.cost = m.model.TruncatedCost(m.window, bound);
  std::stable_sort(models.begin(), models.end(), [](const StartModel& a, const StartModel& b) {
    return a.cost < b.cost;
  });
  return models;
}

}  // namespace cohort
