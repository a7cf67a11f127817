#include "backend/adjust/rolling_shutter.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>

#include "backend/scene/row_poses.h"
#include "backend/scene/spread_tracks.h"
#include "frontend/core/statistics.h"

namespace cohort {
namespace {

constexpr double kMostReadout = 1.0;  // the whole time between two frames

std::map<FrameIndex, Rigid3> PosesByIndex(const WorkingModel& model) {
  std::map<FrameIndex, Rigid3> poses;
  for (const int frame : model.RegisteredFrames()) {
    poses[model.whitened().frames()[frame].index] = model.Pose(frame);
  }
  return poses;
}

// Median depth of the points that the frame sees; 1 without any.
double MedianDepth(const WorkingModel& model, int frame) {
  std::vector<double> depths;
  for (const int o : model.whitened().ObservationsIn(frame)) {
    const int track = model.whitened().observations()[o].track;
    if (model.HasPoint(track)) depths.push_back((model.Pose(frame) * model.Point(track)).z());
  }
  return depths.empty() ? 1.0 : Median(std::move(depths));
}

// Median depth of the model's points whose tracks are in the frame; 1 without any.
double MedianDepth(const TrackFile& file, const Reconstruction& model, FrameIndex frame) {
  std::vector<double> depths;
  for (const Observation* o : file.tracks.InFrame(frame)) {
    const auto point = model.points.find(o->feature);
    if (point == model.points.end()) continue;
    depths.push_back((model.cam_from_world.at(frame) * point->second.in_world).z());
  }
  return depths.empty() ? 1.0 : Median(std::move(depths));
}

// The position in a frame of what its row saw at xy: of the point if it is known, else of the point
// at that depth.
Eigen::Vector2d Corrected(const Camera& camera,
                          const Rigid3& frame_from_world,
                          const Rigid3& row_from_world,
                          const Eigen::Vector2d& xy,
                          const Eigen::Vector3d* point,
                          double depth) {
  const Eigen::Vector3d in_world =
      point != nullptr
          ? *point
          : row_from_world.Inverse() * (depth * camera.Unproject(xy).homogeneous()).eval();
  const auto by_frame = camera.Project(frame_from_world * in_world);
  const auto by_row = camera.Project(row_from_world * in_world);
  return by_frame && by_row ? Eigen::Vector2d(xy + *by_frame - *by_row) : xy;
}

// Whether more rounds are worthwhile: the first round underestimates the readout, because the
// motion of its model ignores the rows.
bool MayRoll(const ReadoutEstimate& first, double deviations) {
  constexpr double kLeast = 0.1;
  return std::abs(first.readout) > std::max(kLeast, deviations * first.sigma);
}

// The derivatives by the readout of the observations that are corrected for it.
std::vector<Eigen::Vector2d> DerivativeByReadout(const WhitenedTracks& observed,
                                                 const WorkingModel& model,
                                                 double readout) {
  constexpr double kDifference = 0.02;
  std::vector<Eigen::Vector2d> d = AsGlobalShutter(observed, model, readout + kDifference);
  const std::vector<Eigen::Vector2d> less = AsGlobalShutter(observed, model, readout - kDifference);
  for (std::size_t i = 0; i < d.size(); ++i) d[i] = (d[i] - less[i]) / (2.0 * kDifference);
  return d;
}

bool IsSettled(double shift, double sigma) {
  constexpr double kSettled = 0.002;
  constexpr double kSettledDeviations = 0.25;
  return std::abs(shift) < std::max(kSettled, kSettledDeviations * sigma);
}

// Bounds the time: this many frames from the middle of the clip determine the readout well.
std::vector<int> FramesInTheMiddle(const WorkingModel& model) {
  constexpr std::size_t kMostFrames = 150;
  const std::vector<int> registered = model.RegisteredFrames();
  const std::size_t count = std::min(registered.size(), kMostFrames);
  const auto first = registered.begin() + static_cast<long>((registered.size() - count) / 2);
  return {first, first + static_cast<long>(count)};
}

// Bundle adjustments of a model with the readout as an additional unknown.
class ReadoutAdjuster {
 public:
  ReadoutAdjuster(const WhitenedTracks& observed,
                  WorkingModel& model,
                  WhitenedTracks& corrected,
                  int first_iterations)
      : observed_(observed),
        model_(model),
        corrected_(corrected),
        frames_(FramesInTheMiddle(model)),
        first_iterations_(first_iterations) {}

  // The cost of the model adjusted to the observations of a global shutter.
  double CostWithout() {
    Correct(0.0);
    return model_.Adjust(frames_, {}, MapperBundleOptions(model_, {}, first_iterations_, 1e-6))
        .bundle.final_cost;
  }

  struct Adjusted {
    double shift;  // of the readout
    double cost;
  };
  // nullopt: the adjustment failed.
  std::optional<Adjusted> Step(double readout) {
    Correct(readout);
    // Later rounds start near the optimum.
    BundleOptions bundle = MapperBundleOptions(model_, {}, first_ ? first_iterations_ : 3, 1e-6);
    bundle.refine_shift = true;
    first_ = false;
    const BundleResult result =
        model_.Adjust(frames_, {}, bundle, DerivativeByReadout(observed_, model_, readout)).bundle;
    if (result.termination == BundleTermination::kFailed) return std::nullopt;
    const double shift = result.solution.shift;
    spdlog::debug("readout {:.4f} by {:+.4f}, cost {:.1f}", readout, shift, result.final_cost);
    return Adjusted{shift, result.final_cost};
  }

  // Starts without a readout and iterates in rounds.
  ReadoutEstimate Estimate(int most_rounds) {
    constexpr double kDeviations = 4.0;
    const double cost_without = CostWithout();
    const double noise = std::max(kMinWhitenedNoise, model_.noise());
    ReadoutEstimate estimate{0.0, std::numeric_limits<double>::infinity()};
    for (int round = 0; round < most_rounds; ++round) {
      const auto step = Step(estimate.readout);
      if (!step) break;
      estimate.readout = std::clamp(estimate.readout + step->shift, -kMostReadout, kMostReadout);
      const double gain = (cost_without - step->cost) / (noise * noise);
      if (gain > 0.0) estimate.sigma = std::abs(estimate.readout) / std::sqrt(2.0 * gain);
      if (round == 0 && !MayRoll(estimate, kDeviations)) break;
      if (IsSettled(step->shift, estimate.sigma)) break;
    }
    return estimate;
  }

  // The readout after steps from the estimate, each with its own inliers.
  double SettledWithOwnInliers(const ReadoutEstimate& estimate) {
    constexpr int kMostRounds = 8;
    constexpr double kMost = 0.99 * kMostReadout;
    double readout = estimate.readout;
    for (int round = 0; round < kMostRounds; ++round) {
      model_.UpdateAllInliers(std::numeric_limits<double>::infinity());
      model_.UpdateAllInliers(model_.ErrorBound());
      const auto step = Step(readout);
      if (!step) break;
      readout = std::clamp(readout + step->shift, -kMost, kMost);
      // The first round uses the inlier bound of the old noise.
      if (round > 0 && IsSettled(step->shift, estimate.sigma)) break;
    }
    return readout;
  }

 private:
  void Correct(double readout) {
    corrected_ = observed_.WithPositions(AsGlobalShutter(observed_, model_, readout));
    model_.SetTracks(corrected_);
  }

  const WhitenedTracks& observed_;
  WorkingModel& model_;
  WhitenedTracks& corrected_;
  std::vector<int> frames_;
  int first_iterations_;
  bool first_ = true;
};

// One round with some of the tracks; the model is unchanged.
ReadoutEstimate EstimateBySomeTracks(const WhitenedTracks& observed, const WorkingModel& model) {
  constexpr int kIterations = 3;
  constexpr std::size_t kEvery = 10;  // frame is used to choose the tracks
  std::vector<int> frames;
  const std::vector<int> middle = FramesInTheMiddle(model);
  for (std::size_t i = 0; i < middle.size(); i += kEvery) frames.push_back(middle[i]);
  const std::vector<int> tracks = SpreadTracks(observed, model.camera(), frames, 1);
  const WhitenedTracks some = observed.Select(tracks);
  WorkingModel trial(some, model, tracks);
  WhitenedTracks corrected = some;
  return ReadoutAdjuster(some, trial, corrected, kIterations).Estimate(1);
}

}  // namespace

bool ReadoutEstimate::IsRolling() const {
  // Systematic errors of tracks look like a readout too. Cameras with a global shutter gave up to
  // 0.28 (at 33 standard deviations where a phone's denoising drags the picture behind the motion),
  // 0.3 to 0.74 at 5 standard deviations, -0.37 at 12, or the end of the range. Rolling shutters
  // read from the first row down and for most of a frame: they were found at 0.5 to 0.9 with 8
  // standard deviations (30 frames) to 70. Tuned on the tuning clips.
  constexpr double kLeast = 0.3;
  constexpr double kDeviations = 7.0;
  constexpr double kDeviationsUpwards = 15.0;
  const double deviations = readout > 0.0 ? kDeviations : kDeviationsUpwards;
  return std::abs(readout) > std::max(kLeast, deviations * sigma) &&
         std::abs(readout) < kMostReadout;
}

std::vector<Eigen::Vector2d> AsGlobalShutter(const WhitenedTracks& observed,
                                             const WorkingModel& model,
                                             double readout) {
  const RowPoses rows(PosesByIndex(model), readout, model.camera(), observed.frame_times());
  std::vector<double> depths(static_cast<std::size_t>(observed.frame_count()), 1.0);
  for (const int frame : model.RegisteredFrames()) {
    depths[static_cast<std::size_t>(frame)] = MedianDepth(model, frame);
  }
  std::vector<Eigen::Vector2d> positions;
  positions.reserve(observed.observations().size());
  for (const WhitenedObservation& o : observed.observations()) {
    Eigen::Vector2d& xy = positions.emplace_back(o.xy);
    if (!model.HasPose(o.frame)) continue;
    const Rigid3 row = rows.CamFromWorld(observed.frames()[o.frame].index, o.xy);
    xy = Corrected(model.camera(),
                   model.Pose(o.frame),
                   row,
                   o.xy,
                   model.HasPoint(o.track) ? &model.Point(o.track) : nullptr,
                   depths[static_cast<std::size_t>(o.frame)]);
  }
  return positions;
}

TrackFile AsGlobalShutter(TrackFile file, const Reconstruction& model) {
  if (model.readout == 0.0) return file;
  const RowPoses rows(model);
  std::map<FrameIndex, double> depths;
  for (const auto& [frame, pose] : model.cam_from_world) {
    depths[frame] = MedianDepth(file, model, frame);
  }
  std::vector<Observation> observations(file.tracks.observations().begin(),
                                        file.tracks.observations().end());
  for (Observation& o : observations) {
    const auto pose = model.cam_from_world.find(o.frame);
    if (pose == model.cam_from_world.end()) continue;
    const auto point = model.points.find(o.feature);
    o.xy = Corrected(CameraOf(model, o.frame),
                     pose->second,
                     rows.CamFromWorld(o.frame, o.xy),
                     o.xy,
                     point != model.points.end() ? &point->second.in_world : nullptr,
                     depths.at(o.frame));
  }
  const auto ends = file.tracks.ends();
  file.tracks = TrackSet::Build(std::move(observations), {ends.begin(), ends.end()});
  return file;
}

void AdjustToReadout(const WhitenedTracks& observed,
                     double readout,
                     WorkingModel& model,
                     WhitenedTracks& corrected) {
  constexpr int kRounds = 4;
  for (int round = 0; round < kRounds; ++round) {
    corrected = observed.WithPositions(AsGlobalShutter(observed, model, readout));
    model.SetTracks(corrected);
    model.UpdateAllInliers(std::numeric_limits<double>::infinity());
    AdjustRegistered(model, MapperBundleOptions(model, {}, 4, 1e-5));
    model.UpdateAllInliers(model.ErrorBound());
  }
}

ReadoutEstimate EstimateReadout(const WhitenedTracks& observed,
                                WorkingModel& model,
                                WhitenedTracks& corrected) {
  constexpr int kMostRounds = 15;
  constexpr int kIterations = 6;
  constexpr double kDeviationsOfSome = 2.0;  // fewer, because some tracks have larger deviations
  const ReadoutEstimate by_some = EstimateBySomeTracks(observed, model);
  if (!MayRoll(by_some, kDeviationsOfSome)) return by_some;
  const WorkingModel before(model);
  ReadoutAdjuster adjuster(observed, model, corrected, kIterations);
  ReadoutEstimate estimate = adjuster.Estimate(kMostRounds);
  if (!estimate.IsRolling()) {
    model = before;
    return estimate;
  }
  // The inliers of the model without a readout decide whether the shutter rolls. But they are those
  // that the rows bend least, which makes the readout a few per cent too small. A last estimate
  // therefore uses its own inliers.
  estimate.readout = adjuster.SettledWithOwnInliers(estimate);
  if (!estimate.IsRolling()) model = before;
  return estimate;
}

double RefineReadout(const WhitenedTracks& observed,
                     const ReadoutEstimate& estimate,
                     WorkingModel& model,
                     WhitenedTracks& corrected) {
  constexpr int kIterations = 6;
  ReadoutAdjuster adjuster(observed, model, corrected, kIterations);
  const ReadoutEstimate refined{adjuster.SettledWithOwnInliers(estimate), estimate.sigma};
  const bool same_way = (refined.readout > 0.0) == (estimate.readout > 0.0);
  return refined.IsRolling() && same_way ? refined.readout : estimate.readout;
}

}  // namespace cohort
