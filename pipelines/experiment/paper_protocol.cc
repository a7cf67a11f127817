#include "pipelines/experiment/paper_protocol.h"

#include <algorithm>

#include "frontend/core/error.h"
#include "frontend/detect/corners.h"

namespace cohort {
namespace {

// The trajectory of the point at `xy` in frame `birth`; `frames` are those of the clip.
FollowedPoint Follow(TrackTruth& truth,
                     const std::vector<FrameIndex>& frames,
                     std::size_t birth,
                     const Eigen::Vector2d& xy,
                     const cv::Size& size,
                     double border_px) {
  FollowedPoint point{birth, {}};
  const auto anchor = truth.Pick(frames[birth], xy);
  for (std::size_t i = birth; anchor && i < frames.size(); ++i) {
    const auto position = truth.Locate(*anchor, frames[i]);
    const bool followed = position && position->visible && position->xy.x() >= border_px &&
                          position->xy.y() >= border_px &&
                          position->xy.x() <= size.width - 1 - border_px &&
                          position->xy.y() <= size.height - 1 - border_px;
    if (!followed) break;
    point.xy.push_back(position->xy);
  }
  return point;
}

}  // namespace

std::vector<FollowedPoint> ChoosePoints(Sequence& clip,
                                        TrackTruth& truth,
                                        DetectorOptions detector,
                                        const PaperProtocolOptions& options) {
  // This determines the share of each cell of the detector's grid.
  detector.max_features = options.features;
  std::vector<FrameIndex> frames;
  std::vector<Frame> starts;
  const auto window = static_cast<std::size_t>(options.window_frames);
  clip.Rewind();
  while (auto frame = clip.Next()) {
    if (frames.size() % window == 0) starts.push_back(*frame);
    frames.push_back(frame->index);
  }
  std::vector<FollowedPoint> points;
  for (std::size_t s = 0; s < starts.size(); ++s) {
    const std::size_t birth = s * window;
    std::vector<Eigen::Vector2d> occupied;
    for (const FollowedPoint& point : points) {
      if (point.end() > birth) occupied.push_back(point.xy[birth - point.birth]);
    }
    const int missing = options.features - static_cast<int>(occupied.size());
    if (missing <= 0 || birth + window >= frames.size()) continue;
    const cv::Mat gray = BuildPyramid(starts[s].gray, 1).levels.front();
    for (const Eigen::Vector2d& xy : DetectCorners(gray,
                                                   occupied,
                                                   starts[s].mask,
                                                   static_cast<int>(options.border_px),
                                                   missing,
                                                   detector)) {
      if (truth.IsOnDepthEdge(frames[birth], xy, options.edge_px)) continue;
      FollowedPoint point = Follow(truth, frames, birth, xy, gray.size(), options.border_px);
      if (point.xy.size() > window) points.push_back(std::move(point));
    }
  }
  return points;
}

ReinitializationRun RunReinitializations(FeatureMover& mover,
                                         const FrameSource& next,
                                         const std::vector<FollowedPoint>& points,
                                         double limit_px) {
  ReinitializationRun run;
  std::vector<const FollowedPoint*> live;  // in the mover's order
  for (std::size_t i = 0; const auto frame = next(); ++i) {
    const Pyramid picture = BuildPyramid(frame->gray);
    std::vector<const FollowedPoint*> started;
    if (!live.empty()) {
      const std::vector<Move> moves = mover.MoveFeatures(picture);
      std::vector<std::uint8_t> keep(live.size(), 0);
      std::vector<const FollowedPoint*> kept;
      for (std::size_t f = 0; f < live.size(); ++f) {
        if (live[f]->end() <= i) continue;  // its trajectory has ended
        const Eigen::Vector2d truth = live[f]->xy[i - live[f]->birth];
        if (!moves[f].loss && (moves[f].xy - truth).norm() <= limit_px) {
          ++run.frames;
          keep[f] = 1;
          kept.push_back(live[f]);
        } else {
          ++run.reinitializations;
          run.lost += moves[f].loss ? 1 : 0;
          started.push_back(live[f]);
        }
      }
      mover.Keep(keep);
      live = std::move(kept);
    }
    for (const FollowedPoint& point : points) {
      if (point.birth == i) started.push_back(&point);
    }
    std::vector<Eigen::Vector2d> born;
    for (const FollowedPoint* point : started) born.push_back(point->xy[i - point->birth]);
    if (!born.empty()) mover.Add(born, picture);
    live.insert(live.end(), started.begin(), started.end());
  }
  return run;
}

TrajectoryRun RunTrajectories(FeatureMover& mover,
                              const FrameSource& next,
                              const std::vector<FollowedPoint>& points,
                              std::size_t frames) {
  struct Feature {
    const FollowedPoint* point;
    Eigen::Vector2d xy;
  };
  std::vector<Feature> features;
  std::vector<Eigen::Vector2d> born;
  for (const FollowedPoint& point : points) {
    if (point.birth != 0) continue;
    Check(point.end() > frames, "points stay visible for the length of the L1 error");
    features.push_back({&point, point.xy.front()});
    born.push_back(point.xy.front());
  }
  TrajectoryRun run;
  run.features = features.size();
  const auto first = next();
  if (!first || features.empty()) return run;
  mover.Add(born, BuildPyramid(first->gray));

  std::vector<std::size_t> live(features.size());  // in the mover's order
  for (std::size_t f = 0; f < live.size(); ++f) live[f] = f;
  double sum_px = 0.0;
  for (std::size_t i = 1; i <= frames; ++i) {
    const auto frame = next();
    Check(frame.has_value(), "the clip is as long as its points are visible");
    if (!live.empty()) {
      const std::vector<Move> moves = mover.MoveFeatures(BuildPyramid(frame->gray));
      std::vector<std::uint8_t> keep(live.size(), 0);
      std::vector<std::size_t> kept;
      for (std::size_t k = 0; k < live.size(); ++k) {
        Feature& feature = features[live[k]];
        if (moves[k].loss) continue;
        feature.xy = moves[k].xy;
        keep[k] = 1;
        kept.push_back(live[k]);
      }
      mover.Keep(keep);
      live = std::move(kept);
    }
    for (const Feature& feature : features) {
      sum_px += (feature.xy - feature.point->xy[i]).lpNorm<1>();
    }
  }
  run.lost = features.size() - live.size();
  run.mean_l1_px = sum_px / static_cast<double>(features.size());
  for (const Feature& feature : features) run.last_xy.push_back(feature.xy);
  return run;
}

TrackerOptions WithoutGivingUp(TrackerOptions options) {
  options.klt.forward_backward_px = 0.0;
  options.anchored_klt.max_unconfirmed_frames = 100000;
  options.rlof.forward_backward_px = 0.0;
  options.measurement.max_unexplained_frames = 0;
  return options;
}

}  // namespace cohort
