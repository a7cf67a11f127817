#include "backend/start/start_models.h"

#include <algorithm>
#include <iterator>
#include <opencv2/calib3d.hpp>
#include <opencv2/core/eigen.hpp>
#include <optional>

#include "backend/start/affine_factorization.h"
#include "backend/start/two_view_geometry.h"

namespace cohort {
namespace {

// Tuned on the tuning clips, as are the bounds below.
constexpr std::size_t kWindowFrames = 8;
constexpr double kMinExplained = 0.5;  // share of the window's observations
constexpr int kMinPoints = 10;

std::vector<int> WindowFrames(const WhitenedTracks& whitened, const FramePairMotion& pair) {
  std::vector<int> usable;
  for (int f = pair.frame_a; f <= pair.frame_b; ++f) {
    if (f == pair.frame_a || f == pair.frame_b ||
        2 * static_cast<int>(whitened.ObservationsIn(f).size()) >= pair.common) {
      usable.push_back(f);
    }
  }
  return Spread(usable, std::min(kWindowFrames, usable.size()));
}

std::vector<int> TracksInFrames(const WhitenedTracks& whitened, const std::vector<int>& frames) {
  std::vector<int> tracks;
  for (const int f : frames) {
    for (const int o : whitened.ObservationsIn(f))
      tracks.push_back(whitened.observations()[o].track);
  }
  std::sort(tracks.begin(), tracks.end());
  tracks.erase(std::unique(tracks.begin(), tracks.end()), tracks.end());
  return tracks;
}

// The poses of the second camera that a homography decomposes into, but for those that stand still.
std::vector<Rigid3> DecomposeHomography(const Eigen::Matrix3d& homography, const Camera& camera) {
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

// Start models of one window of frames.
class WindowBuilder {
 public:
  WindowBuilder(const WhitenedTracks& whitened, const FramePairMotion& pair)
      : whitened_(whitened),
        pair_(pair),
        window_(WindowFrames(whitened, pair)),
        tracks_(TracksInFrames(whitened, window_)) {}

  // First models, not yet grown over the window: two frames with a pose, or all of them.
  std::vector<StartModel> FromRelativePoses(const Camera& camera) const {
    std::vector<StartModel> models;
    const auto add = [&](const Rigid3& cam_b_from_cam_a, StartMethod method) {
      WorkingModel model(whitened_, camera);
      model.SetPose(pair_.frame_a, {});
      model.SetPose(pair_.frame_b, cam_b_from_cam_a);
      model.TriangulateTracks(tracks_);
      models.push_back({std::move(model), method, 0.0, window_});
    };
    const TwoViewGeometry geometry =
        EstimateTwoViewGeometry(whitened_, pair_.frame_a, pair_.frame_b, camera);
    if (geometry.cam2_from_cam1) add(*geometry.cam2_from_cam1, StartMethod::kEssential);
    constexpr double kNearlyPlanar = 0.6;
    if (geometry.homography && geometry.homography_ratio > kNearlyPlanar) {
      for (const Rigid3& pose : DecomposeHomography(*geometry.homography, camera)) {
        add(pose, StartMethod::kHomography);
      }
    }
    return models;
  }

  std::vector<StartModel> FromAffineFactorization(const Camera& camera) const {
    std::vector<StartModel> models;
    const auto affine = FactorizeAffine(static_cast<int>(window_.size()),
                                        static_cast<int>(tracks_.size()),
                                        MeasurementsInWindow(camera));
    if (!affine) return models;
    for (const AffineModel& side : affine->mirror_models) {
      WorkingModel model(whitened_, camera);
      for (std::size_t i = 0; i < window_.size(); ++i) {
        model.SetPose(window_[i], side.cam_from_world[i]);
      }
      // The factorisation's own points: rays of affine poses need not meet under perspective.
      for (std::size_t i = 0; i < tracks_.size(); ++i) {
        model.SetPoint(tracks_[i], side.points_in_world[i]);
      }
      // Generous: the bundle adjustment is to bring them in.
      constexpr double kAffineErrorFactor = 10.0;
      model.UpdateInliers(tracks_, kInfinity, kAffineErrorFactor);
      models.push_back({std::move(model), StartMethod::kAffine, 0.0, window_});
    }
    return models;
  }

  // Grows a first model over the window and adjusts it. False where it does not explain the window.
  bool GrowOverWindow(WorkingModel& model) const {
    if (static_cast<int>(model.CountPoints()) < kMinPoints) return false;
    model.Normalise();
    model.Adjust(model.RegisteredFrames(), {}, WindowBundleOptions(model));
    std::optional<Rigid3> neighbour;
    for (const int f : window_) {
      if (!model.HasPose(f)) model.RegisterFrame(f, neighbour);
      if (model.HasPose(f)) neighbour = model.Pose(f);
    }
    for (int round = 0; round < 2; ++round) {
      model.TriangulateTracks(tracks_);
      model.UpdateAllInliers(kInfinity);
      model.Adjust(model.RegisteredFrames(), {}, WindowBundleOptions(model));
      model.UpdateAllInliers(kInfinity);
      if (static_cast<int>(model.CountPoints()) < kMinPoints) return false;
    }
    if (!ExplainsWindow(model)) return false;
    model.Normalise();
    return true;
  }

 private:
  std::vector<AffineMeasurement> MeasurementsInWindow(const Camera& camera) const {
    std::vector<int> number(whitened_.track_count(), -1);
    for (std::size_t i = 0; i < tracks_.size(); ++i) number[tracks_[i]] = static_cast<int>(i);
    std::vector<AffineMeasurement> measurements;
    for (std::size_t i = 0; i < window_.size(); ++i) {
      for (const int o : whitened_.ObservationsIn(window_[i])) {
        const WhitenedObservation& observation = whitened_.observations()[o];
        measurements.push_back(
            {static_cast<int>(i), number[observation.track], camera.Unproject(observation.xy)});
      }
    }
    return measurements;
  }

  BundleOptions WindowBundleOptions(const WorkingModel& model) const {
    BundleOptions bundle;
    bundle.loss = RobustLoss::kCauchy;
    bundle.loss_scale = std::clamp(model.loss_turn(), 0.1, BundleOptions::kMaxLossScale);
    bundle.max_iterations = 20;
    bundle.function_tolerance = 1e-4;
    return bundle;
  }

  bool ExplainsWindow(const WorkingModel& model) const {
    int with_point = 0;
    int explained = 0;
    for (const int f : window_) {
      for (const int o : whitened_.ObservationsIn(f)) {
        if (!model.HasPoint(whitened_.observations()[o].track)) continue;
        ++with_point;
        if (model.IsInlier(o)) ++explained;
      }
    }
    return explained >= kMinExplained * with_point &&
           2 * model.RegisteredFrames().size() >= window_.size();
  }

  const WhitenedTracks& whitened_;
  FramePairMotion pair_;
  std::vector<int> window_;
  std::vector<int> tracks_;
};

}  // namespace

std::vector<StartModel> BuildStartModels(const WhitenedTracks& whitened,
                                         const Camera& camera,
                                         const FramePairMotion& pair) {
  const WindowBuilder builder(whitened, pair);
  std::vector<StartModel> models;
  std::vector<StartModel> first = builder.FromRelativePoses(camera);
  std::ranges::move(builder.FromAffineFactorization(camera), std::back_inserter(first));
  for (StartModel& model : first) {
    if (builder.GrowOverWindow(model.model)) models.push_back(std::move(model));
  }
  double bound = kMaxReprojectionPx;
  for (const StartModel& m : models) bound = std::min(bound, m.model.ErrorBound());
  for (StartModel& m : models) m.cost = m.model.TruncatedCost(m.window, bound);
  std::stable_sort(models.begin(), models.end(), [](const StartModel& a, const StartModel& b) {
    return a.cost < b.cost;
  });
  return models;
}

}  // namespace cohort
