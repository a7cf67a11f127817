#include "backend/scene/camera_search.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "backend/scene/grown_parts.h"
#include "backend/scene/spread_tracks.h"
#include "backend/scene/start.h"

namespace cohort {
namespace {

// Focal lengths to start from beside the guess, as shares of the longer side of the picture: from 90
// degrees across it to 30. From each of them a model comes to the minimum if the true one is between
// half and twice as long, and mostly from further away.
constexpr double kStartFocals[] = {0.5, 0.9, 1.9};

// Two cameras whose rays through the corner of the picture and whose focal lengths differ by less are
// one: another start of the same minimum ends within a tenth of it.
constexpr double kSameCamera = 0.01;

Camera WithFocal(Camera camera, double focal_px) {
  camera.fy *= focal_px / camera.fx;
  camera.fx = focal_px;
  return camera;
}

bool AreSame(const Camera& a, const Camera& b, double bound = kSameCamera) {
  return a.model == b.model && CornerShift(a, b) < bound && std::abs(std::log(a.fx / b.fx)) < bound;
}

std::vector<Camera> Starts(const Camera& guess) {
  constexpr double kNear = 0.15;  // of log f: what is nearer to the guess tells nothing new
  std::vector<Camera> starts{guess};
  for (const double share : kStartFocals) {
    const double focal_px = share * std::max(guess.width_px, guess.height_px);
    if (std::abs(std::log(focal_px / guess.fx)) > kNear) {
      starts.push_back(WithFocal(guess, focal_px));
    }
  }
  return starts;
}

std::optional<WorkingModel> Settle(const WhitenedTracks& tracks,
                                   const Camera& camera,
                                   const CameraRefinement& refinement,
                                   const std::vector<int>& keyframes) {
  GrownParts grown = GrowPartsBothWays(tracks, camera, keyframes);
  if (grown.parts.empty()) return std::nullopt;
  WorkingModel& model = grown.parts.front().model;
  AdjustCamera(model, refinement);
  spdlog::debug(
      "camera search: from f {:.1f} px to {:.1f}, k1 {:.4f}, k2 {:.4f}; {} frames, noise {:.3f}",
      camera.fx,
      model.camera().fx,
      model.camera().k1,
      model.camera().k2,
      model.registered(),
      model.noise());
  return std::move(grown.parts.front().model);
}

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

// Is the picture so wide that a fisheye differs from what two coefficients make of a pinhole?
bool IsWide(const Camera& camera) {
  constexpr double kWide = 40.0 / 180.0 * std::numbers::pi;  // from the axis to the corner
  return std::atan(camera.Unproject(Eigen::Vector2d::Zero()).norm()) > kWide;
}

}  // namespace

std::optional<FoundCamera> SearchCamera(const WhitenedTracks& whitened,
                                        const Camera& guess,
                                        const CameraRefinement& refinement,
                                        const std::vector<int>& keyframes) {
  constexpr int kPerCell = 2;
  // A lens of another kind is taken if it leaves so much less: by chance it leaves some per cent less.
  constexpr double kBetterLens = 0.9;
  constexpr double kRival = 0.05;  // what is nearer is the same minimum, not quite reached
  const WhitenedTracks some = whitened.Select(SpreadTracks(whitened, guess, keyframes, kPerCell));
  std::vector<WorkingModel> models;  // the cheapest first
  std::vector<int> frames(some.frame_count());
  std::iota(frames.begin(), frames.end(), 0);
  const auto sort = [&] {
    double bound = kInfinity;
    for (const WorkingModel& m : models) bound = std::min(bound, m.ErrorBound());
    std::stable_sort(models.begin(), models.end(), [&](const auto& a, const auto& b) {
      return a.TruncatedCost(frames, bound) < b.TruncatedCost(frames, bound);
    });
  };
  for (const Camera& start : Starts(guess)) {
    auto model = Settle(some, start, refinement, keyframes);
    if (!model) continue;
    const bool agrees = std::any_of(models.begin(), models.end(), [&](const WorkingModel& m) {
      return AreSame(m.camera(), model->camera());
    });
    models.push_back(std::move(*model));
    sort();
    if (agrees) break;
  }
  if (models.empty()) return std::nullopt;
  FoundCamera found{models.front().camera(), std::nullopt};
  for (const WorkingModel& other : models) {
    const auto [cost, other_cost] = CompareCosts(models.front(), other, frames);
    if (AreSame(found.camera, other.camera(), kRival) ||
        IsWorse(other_cost, cost, models.front().noise())) {
      continue;
    }
    found.rival = other.camera();
    break;
  }
  if (refinement.radial && IsWide(found.camera)) {
    const WorkingModel fisheye = AsFisheye(models.front(), refinement);
    const auto [cost, fisheye_cost] = CompareCosts(models.front(), fisheye, frames);
    spdlog::debug("camera search: cost {:.1f}, as a fisheye {:.1f}", cost, fisheye_cost);
    if (fisheye_cost < kBetterLens * cost) found = {fisheye.camera(), std::nullopt};
  }
  return found;
}

}  // namespace cohort
