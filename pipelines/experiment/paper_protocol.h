#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <functional>
#include <optional>
#include <vector>

#include "datasets/readers/sequence.h"
#include "datasets/truth/track_truth.h"
#include "frontend/track/tracker.h"

namespace cohort {

// The paper's section 4: trackers follow points with known trajectories in degraded video. All get
// the same points at their true positions; no tracker detects features.

struct PaperProtocolOptions {
  int features = 100;
  int window_frames = 30;
  double limit_px = 10.0;
  double border_px = 16.0;
  double edge_px = 10.0;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Number("features",
             o.features,
             1,
             100000,
             "number of corners to detect; those with a suitable truth are used");
    v.Number(
        "window_frames",
        o.window_frames,
        1,
        100000,
        "number of frames for which a point must stay visible to be used; length of the L1 error");
    v.Number("limit_px",
             o.limit_px,
             0.1,
             1000.0,
             "distance from the truth beyond which a feature is re-initialised [px]");
    v.Number("border_px",
             o.border_px,
             0.0,
             1000.0,
             "distance from the image border below which a point is no longer followed [px]");
    v.Number("edge_px",
             o.edge_px,
             0.0,
             100.0,
             "minimum distance of the points from depth discontinuities [px]");
  }
};

// A scene point, from the first frame in which it is followed (counted from the clip's first) until
// it is first hidden or near the border.
struct FollowedPoint {
  std::size_t birth = 0;
  std::vector<Eigen::Vector2d> xy;  // true positions; xy[0] is in frame `birth`

  std::size_t end() const { return birth + xy.size(); }
};

// The points of a clip before degradation, as in the paper: corners of the common detector in its
// frames 0, w, 2w, ... (w: window_frames), in the later ones as many as are missing from
// `features`. A corner is used if it lies on a surface, with no depth jump nearby, and stays
// visible and off the border for w more frames. No corner is where the frame's mask is 0.
std::vector<FollowedPoint> ChoosePoints(Sequence& clip,
                                        TrackTruth& truth,
                                        DetectorOptions detector,
                                        const PaperProtocolOptions& options);

// The next frame of a clip; nullopt at the end.
using FrameSource = std::function<std::optional<Frame>()>;

// First mode: a feature that the tracker loses, or that is more than limit_px off, restarts at its
// true position. `frames` counts the frames of features within the limit.
struct ReinitializationRun {
  std::size_t frames = 0;
  std::size_t reinitializations = 0;
  std::size_t lost = 0;  // of these: lost by the tracker
  // The paper's figure; without re-initialisations, a lower bound.
  double MeanFramesBetween() const {
    return static_cast<double>(frames) /
           static_cast<double>(std::max<std::size_t>(reinitializations, 1));
  }
};
ReinitializationRun RunReinitializations(FeatureMover& mover,
                                         const FrameSource& next,
                                         const std::vector<FollowedPoint>& points,
                                         double limit_px);

// Second mode: follows the points of frame 0 for `frames` frames without restarts. A feature that
// the tracker gives up keeps its last position, so that giving up has no advantage.
struct TrajectoryRun {
  std::size_t features = 0;
  std::size_t lost = 0;
  double mean_l1_px = 0.0;               // over features: sum over the frames of |dx| + |dy|
  std::vector<Eigen::Vector2d> last_xy;  // of the features, in the order of their points
};
TrajectoryRun RunTrajectories(FeatureMover& mover,
                              const FrameSource& next,
                              const std::vector<FollowedPoint>& points,
                              std::size_t frames);

// A tracker without the checks by which it gives up: both modes need a position in every frame, and
// each check costs a tracker more than it gains.
TrackerOptions WithoutGivingUp(TrackerOptions options);

}  // namespace cohort
