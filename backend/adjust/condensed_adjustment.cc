#include "backend/adjust/condensed_adjustment.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "backend/scene/reprojection.h"
#include "frontend/core/statistics.h"

namespace cohort {
namespace {

double CauchyWeight(double squared_error, double turn) {
  return 1.0 / (1.0 + squared_error / (turn * turn));
}

// The information of one run's frames about a point.
struct Sighting {
  int run = 0;
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
  Eigen::Vector2d weighted_error = Eigen::Vector2d::Zero();  // sum A_k r_k
};

std::vector<Sighting> SightingsOf(const WorkingModel& model,
                                  const FrameRuns& runs,
                                  int track,
                                  double turn) {
  std::vector<Sighting> sightings;
  const auto [first, last] = model.whitened().TrackRange(track);
  for (int o = first; o < last; ++o) {
    const WhitenedObservation& observation = model.whitened().observations()[o];
    if (!model.IsInlier(o) || !runs.is_in_run[observation.frame]) continue;
    const std::optional<Eigen::Vector2d> error = model.PixelError(o);
    if (!error) continue;
    const int run = runs.run_of_frame[observation.frame];
    if (sightings.empty() || sightings.back().run != run) sightings.push_back({run});
    const double weight = CauchyWeight((observation.whitening * *error).squaredNorm(), turn);
    const Eigen::Matrix2d information =
        weight * observation.whitening.transpose() * observation.whitening;
    sightings.back().information += information;
    sightings.back().weighted_error += information * *error;
  }
  return sightings;
}

// The keyframes, the points that at least two of them see, and the tracks of these points.
struct CondensedProblem {
  BundleProblem bundle;
  std::vector<int> tracks;
};
CondensedProblem Condense(const WorkingModel& model, const FrameRuns& runs, double turn) {
  // A keyframe need not see everything that its run sees. But a point further outside than this
  // share of the picture's width (a near point that the camera has passed) would be seen from
  // another direction.
  constexpr double kMostOutside = 0.5;
  const Camera& camera = model.camera();
  CondensedProblem problem;
  problem.bundle.intrinsics = camera;
  for (const int frame : runs.keyframes) {
    problem.bundle.cameras.push_back({model.Pose(frame), false});
  }
  std::vector<BundleObservation>& observations = problem.bundle.observations;
  for (int track = 0; track < model.whitened().track_count(); ++track) {
    if (!model.HasPoint(track)) continue;
    const std::size_t before = observations.size();
    for (const Sighting& s : SightingsOf(model, runs, track, turn)) {
      const auto xy = camera.Project(model.Pose(runs.keyframes[s.run]) * model.Point(track));
      if (!xy || !camera.Contains(*xy, -kMostOutside * camera.width_px)) continue;
      const Eigen::Matrix2d covariance = s.information.inverse();
      observations.push_back({s.run,
                              static_cast<int>(problem.tracks.size()),
                              *xy - covariance * s.weighted_error,
                              covariance});
    }
    if (observations.size() < before + 2) {
      observations.resize(before);
      continue;
    }
    problem.tracks.push_back(track);
    problem.bundle.points_in_world.push_back(model.Point(track));
  }
  return problem;
}

// Gauss-Newton steps for one pose or one point, from observations weighted by Cauchy's loss:
// `terms` sums them up at x, `moved` is x after a step. The best x is kept.
template <int N>
struct NormalEquations {
  Eigen::Matrix<double, N, N> H = Eigen::Matrix<double, N, N>::Zero();
  Eigen::Matrix<double, N, 1> g = Eigen::Matrix<double, N, 1>::Zero();
  double cost = 0.0;
  int observations = 0;

  template <typename Jacobian>
  void Add(const WhitenedObservation& o,
           const PixelProjection& projected,
           const Jacobian& d_n,
           double turn) {
    const Eigen::Vector2d error = o.whitening * (projected.xy - o.xy);
    const double weight = CauchyWeight(error.squaredNorm(), turn);
    const Eigen::Matrix<double, 2, N> J = (o.whitening * projected.d_n) * d_n;
    H.noalias() += weight * J.transpose() * J;
    g.noalias() += weight * J.transpose() * error;
    cost -= turn * turn * std::log(weight);
    ++observations;
  }
};
template <int N, typename X, typename Terms, typename Moved>
X Minimise(const X& start, int max_steps, const Terms& terms, const Moved& moved) {
  constexpr double kSettled = 1e-5;  // of the cost
  X best = start;
  X x = start;
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= max_steps; ++i) {
    const NormalEquations<N> sum = terms(x);
    if (2 * sum.observations < N || !(sum.cost < least)) break;
    best = x;
    least = sum.cost;
    const Eigen::Matrix<double, N, 1> step = -sum.H.ldlt().solve(sum.g);
    if (!step.allFinite() || -sum.g.dot(step) < kSettled * least) break;
    x = moved(x, step);
  }
  return best;
}

CameraPose PoseOf(const WorkingModel& model, int frame) {
  return {model.Pose(frame).rotation, model.Pose(frame).Inverse().translation};
}

void AdjustPosesAlone(WorkingModel& model, double turn) {
  constexpr int kMostSteps = 3;
  const std::vector<WhitenedObservation>& observations = model.whitened().observations();
  for (const int frame : model.RegisteredFrames()) {
    const auto terms = [&](const CameraPose& pose) {
      NormalEquations<6> sum;
      for (const int o : model.whitened().ObservationsIn(frame)) {
        if (!model.IsInlier(o)) continue;
        const NormalisedProjection p = ProjectNormalised(pose, model.Point(observations[o].track));
        sum.Add(observations[o], ProjectPixel(model.camera(), p.n), p.d_pose, turn);
      }
      return sum;
    };
    const CameraPose pose = Minimise<6>(PoseOf(model, frame), kMostSteps, terms, MovedPose);
    model.SetPose(frame, {pose.rotation, -(pose.rotation * pose.center)});
  }
}

void AdjustPointsAlone(WorkingModel& model, double turn) {
  constexpr int kMostSteps = 3;
  const std::vector<WhitenedObservation>& observations = model.whitened().observations();
  std::vector<CameraPose> poses(model.whitened().frame_count());
  for (const int frame : model.RegisteredFrames()) poses[frame] = PoseOf(model, frame);
  for (int track = 0; track < model.whitened().track_count(); ++track) {
    if (!model.HasPoint(track)) continue;
    const auto [first, last] = model.whitened().TrackRange(track);
    const auto terms = [&, first = first, last = last](const Eigen::Vector3d& x) {
      NormalEquations<3> sum;
      for (int o = first; o < last; ++o) {
        if (!model.IsInlier(o)) continue;
        const NormalisedProjection p = ProjectNormalised(poses[observations[o].frame], x);
        sum.Add(observations[o], ProjectPixel(model.camera(), p.n), p.d_point, turn);
      }
      return sum;
    };
    const auto moved = [](const Eigen::Vector3d& x, const Eigen::Vector3d& step) {
      return Eigen::Vector3d(x + step);
    };
    model.SetPoint(track, Minimise<3>(model.Point(track), kMostSteps, terms, moved));
  }
}

// The registered frames in runs, in order.
std::vector<std::vector<int>> ShortRuns(const WorkingModel& model) {
  // Chosen on the tuning clips, whose camera errors stayed those of the joint adjustment of all
  // frames; with KLT's short tracks and in a long orbit, some are up to a tenth larger.
  constexpr double kRunsOfTrack = 8.0;
  constexpr double kShortTracks = 0.25;  // quantile of the lengths of the tracks in a frame
  // Path of the camera in a run, divided by the depth of the scene.
  constexpr double kMostParallax = 0.05;
  const WhitenedTracks& whitened = model.whitened();
  std::vector<int> views(whitened.track_count(), 0);
  for (int o = 0; o < static_cast<int>(whitened.observations().size()); ++o) {
    if (model.IsInlier(o)) ++views[whitened.observations()[o].track];
  }
  std::vector<std::vector<int>> runs;
  double full = 0.0;  // share of the current run that is used up
  Eigen::Vector3d first_center = Eigen::Vector3d::Zero();
  for (const int frame : model.RegisteredFrames()) {
    std::vector<double> lengths;
    std::vector<double> depths;
    for (const int o : whitened.ObservationsIn(frame)) {
      if (!model.IsInlier(o)) continue;
      const int track = whitened.observations()[o].track;
      lengths.push_back(views[track]);
      depths.push_back((model.Pose(frame) * model.Point(track)).z());
    }
    const double length = lengths.empty() ? 0.0 : Quantile(std::move(lengths), kShortTracks);
    const double depth = depths.empty() ? 0.0 : Median(std::move(depths));
    const Eigen::Vector3d center = PoseOf(model, frame).center;
    const double share = kRunsOfTrack / std::max(kRunsOfTrack, length);
    if (runs.empty() || full + share > 1.0 ||
        (center - first_center).norm() > kMostParallax * depth) {
      runs.emplace_back();
      full = 0.0;
      first_center = center;
    }
    full += share;
    runs.back().push_back(frame);
  }
  return runs;
}

// Whether each run is used: all are, but where tracks cross very many runs, only as many, evenly
// spread, as these tracks need.
std::vector<char> SpeakingRuns(const WorkingModel& model,
                               const std::vector<std::vector<int>>& runs) {
  constexpr double kEnoughOfTrack = 60.0;
  constexpr double kShortTracks = 0.25;
  const WhitenedTracks& whitened = model.whitened();
  std::vector<int> run_of_frame(whitened.frame_count(), -1);
  for (std::size_t run = 0; run < runs.size(); ++run) {
    for (const int frame : runs[run]) run_of_frame[frame] = static_cast<int>(run);
  }
  std::vector<int> crossed(whitened.track_count(), 0);
  for (int track = 0; track < whitened.track_count(); ++track) {
    int last = -1;
    const auto [first, end] = whitened.TrackRange(track);
    for (int o = first; o < end; ++o) {
      const int run = run_of_frame[whitened.observations()[o].frame];
      if (!model.IsInlier(o) || run == last) continue;
      ++crossed[track];
      last = run;
    }
  }
  std::vector<char> speaks;
  double due = 1.0;
  for (const std::vector<int>& run : runs) {
    std::vector<double> counts;
    for (const int o : whitened.ObservationsIn(run[run.size() / 2])) {
      if (model.IsInlier(o)) counts.push_back(crossed[whitened.observations()[o].track]);
    }
    const double count = counts.empty() ? 0.0 : Quantile(std::move(counts), kShortTracks);
    due += kEnoughOfTrack / std::max(kEnoughOfTrack, count);
    speaks.push_back(due >= 1.0 ? 1 : 0);
    if (due >= 1.0) due -= 1.0;
  }
  return speaks;
}

}  // namespace

bool FrameRuns::Condense() const {
  constexpr double kWorthIt = 0.6;
  const auto registered = run_of_frame.size() - static_cast<std::size_t>(std::count(
                                                    run_of_frame.begin(), run_of_frame.end(), -1));
  return static_cast<double>(keyframes.size()) <= kWorthIt * static_cast<double>(registered);
}

FrameRuns ChooseRuns(const WorkingModel& model) {
  const std::vector<std::vector<int>> all = ShortRuns(model);
  const std::vector<char> speaks = SpeakingRuns(model, all);
  FrameRuns runs;
  runs.run_of_frame.assign(model.whitened().frame_count(), -1);
  runs.is_in_run.assign(model.whitened().frame_count(), 0);
  for (std::size_t run = 0; run < all.size(); ++run) {
    if (speaks[run]) runs.keyframes.push_back(all[run][all[run].size() / 2]);
    for (const int frame : all[run]) {
      runs.run_of_frame[frame] = static_cast<int>(runs.keyframes.size()) - 1;
      runs.is_in_run[frame] = speaks[run];
    }
  }
  return runs;
}

BundleResult AdjustCondensed(WorkingModel& model,
                             const FrameRuns& runs,
                             const BundleOptions& options) {
  // With 1e4, the cameras of a path of 2000 frames had five times the error.
  constexpr double kTrustRadius = 1e8;
  CondensedProblem problem = Condense(model, runs, options.loss_scale);
  BundleOptions bundle = options;
  bundle.loss = RobustLoss::kNone;  // the weights contain it
  bundle.trust_radius = kTrustRadius;
  BundleResult result = AdjustBundle(std::move(problem.bundle), bundle);
  if (result.termination == BundleTermination::kFailed) return result;
  std::vector<Rigid3> moved;  // of the runs, new world from old one
  for (std::size_t run = 0; run < runs.keyframes.size(); ++run) {
    const Rigid3& cam_from_world = result.solution.cameras[run].cam_from_world;
    moved.push_back(model.Pose(runs.keyframes[run]).Inverse() * cam_from_world);
  }
  for (const int frame : model.RegisteredFrames()) {
    model.SetPose(frame, model.Pose(frame) * moved[runs.run_of_frame[frame]]);
  }
  for (std::size_t i = 0; i < problem.tracks.size(); ++i) {
    model.SetPoint(problem.tracks[i], result.solution.points_in_world[i]);
  }
  FollowCamera(model, options.loss_scale);
  return result;
}

void FollowCamera(WorkingModel& model, double turn) {
  AdjustPosesAlone(model, turn);
  AdjustPointsAlone(model, turn);
}

}  // namespace cohort
