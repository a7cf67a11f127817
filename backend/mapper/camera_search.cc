#include "backend/mapper/camera_search.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "backend/grow/grown_parts.h"
#include "backend/scene/spread_tracks.h"
#include "backend/start/start.h"

namespace cohort {
namespace {

// Focal lengths to start from besides the guess, as shares of the longer side of the picture: from
// 90 to 30 degrees across it. From each of them a model converges to the minimum if the true focal
// length is between half and twice as long, and mostly also if it is further away.
constexpr double kStartFocals[] = {0.5, 0.9, 1.9};

// Two cameras are the same if their rays through the corner of the picture and their focal lengths
// differ by less: two searches that reach the same minimum end within 0.5 % of each other on noisy
// tracks.
constexpr double kSameCamera = 0.01;

Camera WithFocal(Camera camera, double focal_px) {
  camera.fy *= focal_px / camera.fx;
  camera.fx = focal_px;
  return camera;
}

bool AreSame(const Camera& a, const Camera& b, double bound = kSameCamera) {
  return a.model == b.model && CornerShift(a, b) < bound && std::abs(std::log(a.fx / b.fx)) < bound;
}

std::vector<Camera> Starts(const Camera& guess, const std::optional<Camera>& found_before) {
  constexpr double kNear = 0.15;  // of log f: a start nearer to the guess adds nothing
  std::vector<Camera> starts;
  if (found_before) starts.push_back(*found_before);
  starts.push_back(guess);
  for (const double share : kStartFocals) {
    const double focal_px = share * std::max(guess.width_px, guess.height_px);
    if (std::abs(std::log(focal_px / guess.fx)) > kNear) {
      starts.push_back(WithFocal(guess, focal_px));
    }
  }
  return starts;
}

// The parts of the clip, the largest adjusted with its camera; without any, there is no model.
GrownParts Settle(const WhitenedTracks& tracks,
                  const Camera& camera,
                  const CameraRefinement& refinement,
                  const std::vector<int>& keyframes) {
  GrownParts grown = GrowParts(tracks, camera, keyframes);
  if (grown.parts.empty()) return grown;
  WorkingModel& model = grown.parts.front();
  AdjustCamera(model, refinement);
  spdlog::debug(
      "camera search: from f {:.1f} px to {:.1f}, k1 {:.4f}, k2 {:.4f}; {} frames, noise {:.3f}",
      camera.fx,
      model.camera().fx,
      model.camera().k1,
      model.camera().k2,
      model.registered(),
      model.noise());
  return grown;
}

const WorkingModel& LargestOf(const GrownParts& grown) { return grown.parts.front(); }

// The same poses and points seen through a fisheye lens, adjusted. To third order in the angle a
// pinhole's k1 is a fisheye's k1 - 1/3.
WorkingModel AsFisheye(WorkingModel model, const CameraRefinement& refinement) {
  Camera camera = model.camera();
  camera.model = CameraModel::kFisheye;
  camera.k1 += 1.0 / 3.0;
  camera.k2 = 0.0;
  model.SetCamera(camera);
  AdjustCamera(model, refinement);
  spdlog::debug("camera search: as a fisheye f {:.1f} px, k1 {:.4f}, k2 {:.4f}, noise {:.3f}",
                camera.fx,
                model.camera().k1,
                model.camera().k2,
                model.noise());
  return model;
}

// Whether the picture is so wide that a fisheye differs from a pinhole with two coefficients.
bool IsWide(const Camera& camera) {
  constexpr double kWide = 40.0 / 180.0 * std::numbers::pi;  // from the axis to the corner
  return std::atan(camera.Unproject(Eigen::Vector2d::Zero()).norm()) > kWide;
}

}  // namespace

std::optional<FoundCamera> SearchCamera(const WhitenedTracks& whitened,
                                        const Camera& guess,
                                        const std::optional<Camera>& found_before,
                                        const CameraRefinement& refinement,
                                        const std::vector<int>& keyframes) {
  // Another kind of lens is chosen if it reduces the cost this much: by chance the cost decreases
  // by a few per cent.
  constexpr double kBetterLens = 0.9;
  constexpr double kRival = 0.05;  // a nearer camera is the same minimum, not quite reached
  const WhitenedTracks some = whitened.Select(SpreadTracks(whitened, guess, keyframes));
  std::vector<GrownParts> hypotheses;  // ascending costs
  std::vector<int> frames(some.frame_count());
  std::iota(frames.begin(), frames.end(), 0);
  const auto sort = [&] {
    double bound = kInfinity;
    for (const GrownParts& h : hypotheses) bound = std::min(bound, LargestOf(h).ErrorBound());
    std::stable_sort(hypotheses.begin(), hypotheses.end(), [&](const auto& a, const auto& b) {
      return LargestOf(a).TruncatedCost(frames, bound) < LargestOf(b).TruncatedCost(frames, bound);
    });
  };
  for (const Camera& start : Starts(guess, found_before)) {
    GrownParts hypothesis = Settle(some, start, refinement, keyframes);
    if (hypothesis.parts.empty()) continue;
    const Camera& camera = LargestOf(hypothesis).camera();
    const bool agrees = (found_before && AreSame(*found_before, camera, kRival)) ||
                        std::ranges::any_of(hypotheses, [&](const GrownParts& other) {
                          return AreSame(LargestOf(other).camera(), camera);
                        });
    hypotheses.push_back(std::move(hypothesis));
    sort();
    if (agrees) break;
  }
  if (hypotheses.empty()) return std::nullopt;
  WorkingModel& best = hypotheses.front().parts.front();
  FoundCamera found{best.camera(), std::nullopt, std::nullopt};
  for (const GrownParts& hypothesis : hypotheses) {
    const WorkingModel& other = LargestOf(hypothesis);
    const auto [cost, other_cost] = CompareCosts(best, other, frames);
    if (AreSame(found.camera, other.camera(), kRival) || IsWorse(other_cost, cost, best.noise())) {
      continue;
    }
    found.rival = other.camera();
    break;
  }
  if (refinement.radial && IsWide(found.camera) && found.camera.model == CameraModel::kPinhole) {
    WorkingModel fisheye = AsFisheye(best, refinement);
    const auto [cost, fisheye_cost] = CompareCosts(best, fisheye, frames);
    spdlog::debug("camera search: cost {:.1f}, as a fisheye {:.1f}", cost, fisheye_cost);
    if (fisheye_cost < kBetterLens * cost) {
      found = {fisheye.camera(), std::nullopt, std::nullopt};
      best = std::move(fisheye);
    }
  }
  found.grown = WithAllTracks(whitened, hypotheses.front(), keyframes);
  return found;
}

}  // namespace cohort
