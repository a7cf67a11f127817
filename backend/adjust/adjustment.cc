#include "backend/adjust/adjustment.h"

#include <spdlog/spdlog.h>

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <span>

#include "backend/adjust/condensed_adjustment.h"
#include "backend/scene/spread_tracks.h"

namespace cohort {
namespace {

// The variance of every centre (trace over its three coordinates) that remains after the
// best-fitting similarity, P C P' with P = I - Q Q' and Q an orthonormal basis of the motions of a
// similarity, as a share of the mean square distance of the centres from their mean. `covariance`:
// of all centres.
std::vector<double> SharesAfterSimilarity(const std::vector<Eigen::Vector3d>& centers,
                                          const Eigen::MatrixXd& covariance) {
  const auto count = static_cast<Eigen::Index>(centers.size());
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& c : centers) mean += c / static_cast<double>(count);
  double extent2 = 0.0;
  Eigen::MatrixXd moves = Eigen::MatrixXd::Zero(3 * count, 7);
  for (Eigen::Index i = 0; i < count; ++i) {
    const Eigen::Vector3d c = centers[static_cast<std::size_t>(i)] - mean;
    moves.block<3, 3>(3 * i, 0).setIdentity();
    moves.block<3, 3>(3 * i, 3) << 0, -c.z(), c.y(), c.z(), 0, -c.x(), -c.y(), c.x(), 0;
    moves.block<3, 1>(3 * i, 6) = c;
    extent2 += c.squaredNorm() / static_cast<double>(count);
  }
  // If the path is straight, one rotation moves nothing.
  const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> qr(moves);
  const Eigen::MatrixXd Q =
      Eigen::MatrixXd(qr.householderQ() * Eigen::MatrixXd::Identity(3 * count, qr.rank()));
  const Eigen::MatrixXd CQ = covariance * Q;
  const Eigen::MatrixXd QQCQ = Q * (Q.transpose() * CQ);
  const Eigen::VectorXd of_coordinates =
      covariance.diagonal() + (QQCQ - 2.0 * CQ).cwiseProduct(Q).rowwise().sum();
  std::vector<double> shares;
  for (Eigen::Index i = 0; i < count; ++i) {
    shares.push_back(std::max(of_coordinates.segment<3>(3 * i).sum(), 0.0) / extent2);
  }
  return shares;
}

}  // namespace

BundleOptions MapperBundleOptions(const WorkingModel& model,
                                  const CameraRefinement& refinement,
                                  int max_iterations,
                                  double function_tolerance) {
  BundleOptions bundle;
  bundle.loss = RobustLoss::kCauchy;
  // Tracks with tiny covariances may exceed any bound in units of their standard deviations.
  bundle.loss_scale =
      std::clamp(model.loss_turn(), kMinWhitenedNoise, BundleOptions::kMaxLossScale);
  bundle.max_iterations = max_iterations;
  bundle.function_tolerance = function_tolerance;
  bundle.refine_focal = refinement.focal;
  bundle.focal_prior_px = refinement.focal_prior_px;
  bundle.focal_prior_log_sigma = refinement.focal_prior_log_sigma;
  bundle.prior_noise = std::max(model.noise(), kMinWhitenedNoise);
  bundle.refine_radial = refinement.radial;
  bundle.refine_principal_point = refinement.principal_point;
  return bundle;
}

void AdjustAround(WorkingModel& model, int frame) {
  // The number of frames that move, and of neighbours that are fixed. Tuned on the tuning clips.
  constexpr std::size_t kFree = 4;
  constexpr std::size_t kFixed = 6;
  const std::vector<int> near = model.NearestRegistered(frame, kFree + kFixed);
  const std::size_t free = std::min(kFree, near.size());
  BundleOptions bundle = MapperBundleOptions(model, {}, 6, 1e-3);
  // A new pose is not settled yet: the loss scale of the settled part would treat all its
  // observations as outliers.
  bundle.loss_scale =
      std::clamp(2.0 * model.MedianError(frame), bundle.loss_scale, BundleOptions::kMaxLossScale);
  model.Adjust(std::span(near).first(free), std::span(near).subspan(free), bundle);
}

BundleResult AdjustRegistered(WorkingModel& model, const BundleOptions& options) {
  const FrameRuns runs = ChooseRuns(model);
  if (runs.Condense()) return AdjustCondensed(model, runs, options);
  return model.Adjust(model.RegisteredFrames(), {}, options).bundle;
}

void AdjustAll(WorkingModel& model) {
  model.UpdateAllInliers(kInfinity);
  AdjustRegistered(model, MapperBundleOptions(model, {}, 10, 1e-3));
  model.UpdateAllInliers(kInfinity);
  model.TriangulateAllTracks();
}

void AdjustUntilSettled(WorkingModel& model, int max_rounds, int first_iterations) {
  // Share of the observations that change between inlier and outlier. Tuned on the tuning clips.
  constexpr double kSettled = 2e-3;
  const auto observations = static_cast<double>(model.whitened().observations().size());
  model.UpdateAllInliers(kInfinity);
  for (int round = 0; round < max_rounds; ++round) {
    // Later rounds start near the optimum, so half the iterations suffice.
    const int iterations = round == 0 ? first_iterations : std::max(2, first_iterations / 2);
    const BundleResult adjustment =
        AdjustRegistered(model, MapperBundleOptions(model, {}, iterations, 1e-5));
    const int changes = model.UpdateAllInliers(model.ErrorBound());
    const int found = model.TriangulateAllTracks();
    spdlog::debug("{}; {} observations change sides, {} new points, noise {:.3f}",
                  adjustment.Brief(),
                  changes,
                  found,
                  model.noise());
    if (changes + found < kSettled * observations) break;
  }
}

// The cost alone does not show when the camera is at its minimum: with a tolerance of 1e-4, focal
// lengths stopped three standard deviations short, and with 1e-6, outliers keep moving for twice
// the iterations.
BundleOptions CameraBundleOptions(const WorkingModel& model, const CameraRefinement& refinement) {
  BundleOptions bundle = MapperBundleOptions(model, refinement, 100, 1e-6);
  bundle.settled_camera = 3e-5;
  return bundle;
}

void AdjustCamera(WorkingModel& model, const CameraRefinement& refinement) {
  constexpr std::size_t kCalibrationFrames = 60;  // bounds the time
  constexpr int kMostRounds = 10;
  // Shift of the picture's corner from round to round, as a share of the picture's half diagonal.
  constexpr double kSettled = 1e-3;
  std::vector<int> frames = model.RegisteredFrames();
  if (frames.size() > kCalibrationFrames) frames = Spread(frames, kCalibrationFrames);
  model.UpdateAllInliers(kInfinity);
  for (int round = 0; round < kMostRounds; ++round) {
    const Camera before = model.camera();
    const BundleOptions bundle = CameraBundleOptions(model, refinement);
    const BundleResult result = model.Adjust(frames, {}, bundle).bundle;
    if (frames.size() < static_cast<std::size_t>(model.registered())) {
      FollowCamera(model, bundle.loss_scale);
    }
    model.UpdateAllInliers(kInfinity);
    const int changes = model.UpdateAllInliers(model.ErrorBound());
    model.TriangulateAllTracks();
    spdlog::debug("{}; f {:.2f}, k1 {:.4f}, k2 {:.4f}, {} changes, noise {:.4f}",
                  result.Brief(),
                  model.camera().fx,
                  model.camera().k1,
                  model.camera().k2,
                  changes,
                  model.noise());
    if (CornerShift(before, model.camera()) < kSettled) break;
  }
}

void AdjustToMinimum(WorkingModel& model) {
  constexpr std::size_t kMostFrames = 300;  // bounds the time, as kMostIterations does
  constexpr int kMostIterations = 50;
  const std::vector<int> frames = model.RegisteredFrames();
  if (frames.size() > kMostFrames) return;
  const BundleOptions bundle = MapperBundleOptions(model, {}, kMostIterations, 1e-5);
  const BundleResult result = model.Adjust(frames, {}, bundle).bundle;
  spdlog::debug("to the minimum: {}", result.Brief());
  model.UpdateAllInliers(model.ErrorBound());
  model.TriangulateAllTracks();
}

void AdjustPoints(WorkingModel& model) {
  model.Adjust({}, model.RegisteredFrames(), MapperBundleOptions(model, {}, 20, 1e-6));
}

std::optional<Camera> FindBetterCamera(const WorkingModel& model,
                                       const std::vector<int>& keyframes) {
  constexpr std::size_t kMinFrames = 4;
  constexpr std::size_t kMaxFrames = 16;  // bounds the time
  // Three more parameters cannot remove a fifth of the cost of hundreds of residuals by chance.
  constexpr double kMuchBetter = 0.8;
  std::vector<int> frames;
  for (const int f : keyframes) {
    if (model.HasPose(f)) frames.push_back(f);
  }
  if (frames.size() < kMinFrames) return std::nullopt;
  if (frames.size() > kMaxFrames) frames = Spread(frames, kMaxFrames);
  const WhitenedTracks& whitened = model.whitened();
  const std::vector<int> tracks = SpreadTracks(whitened, model.camera(), frames);
  const WhitenedTracks some = whitened.Select(tracks);
  WorkingModel trial(some, model, tracks);
  BundleOptions bundle = MapperBundleOptions(trial, {}, 10, 1e-4);
  const BundleResult before = trial.Adjust(frames, {}, bundle).bundle;
  bundle.refine_focal = bundle.refine_radial = true;
  const BundleResult after = trial.Adjust(frames, {}, bundle).bundle;
  if (before.termination == BundleTermination::kFailed ||
      after.termination == BundleTermination::kFailed) {
    return std::nullopt;  // so their costs are not comparable
  }
  spdlog::debug("another camera: fx {:.1f}, k1 {:.4f}, k2 {:.4f}, cost {:.1f} -> {:.1f} ({:.3f})",
                trial.camera().fx,
                trial.camera().k1,
                trial.camera().k2,
                before.final_cost,
                after.final_cost,
                after.final_cost / before.final_cost);
  if (after.final_cost < kMuchBetter * before.final_cost) return trial.camera();
  return std::nullopt;
}

std::optional<ModelCovariances> CovariancesAtOptimum(WorkingModel model,
                                                     const CameraRefinement& refinement) {
  const std::vector<int> frames = model.RegisteredFrames();
  BundleOptions bundle = MapperBundleOptions(model, refinement, 2, 1e-8);  // it has settled
  bundle.covariances = true;
  const ModelAdjustment adjustment = model.Adjust(frames, {}, bundle);
  const std::optional<BundleCovariances>& covariances = adjustment.bundle.covariances;
  if (!covariances) return std::nullopt;
  const WhitenedTracks& whitened = model.whitened();
  const double variance = model.noise() * model.noise();
  ModelCovariances result;
  if (refinement.focal) {
    result.focal = std::sqrt(variance * covariances->intrinsics(0, 0)) /
                   adjustment.bundle.solution.intrinsics.fx;
  }
  for (std::size_t i = 0; i < frames.size(); ++i) {
    result.cameras[whitened.frames()[frames[i]].index] = variance * covariances->cameras[i];
  }
  std::vector<Eigen::Vector3d> centers;
  for (const int frame : frames) centers.push_back(model.Pose(frame).Inverse().translation);
  const std::vector<double> shares = SharesAfterSimilarity(centers, covariances->centers);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    result.centers[whitened.frames()[frames[i]].index] = model.noise() * std::sqrt(shares[i]);
  }
  for (std::size_t i = 0; i < adjustment.tracks.size(); ++i) {
    result.points[whitened.features()[adjustment.tracks[i]]] = variance * covariances->points[i];
  }
  return result;
}

}  // namespace cohort
