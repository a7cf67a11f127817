#include "backend/start/start.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <utility>

namespace cohort {
namespace {

bool AreSimilar(const FramePairMotion& a, const FramePairMotion& b) {
  constexpr double kOverlap = 0.7;
  const int overlap = std::min(a.frame_b, b.frame_b) - std::max(a.frame_a, b.frame_a);
  return overlap > kOverlap * (b.frame_b - b.frame_a) &&
         overlap > kOverlap * (a.frame_b - a.frame_a);
}

void LogStart(const FramePairMotion& pair, const StartModel& start) {
  spdlog::debug("start in frames {} to {} by {}: cost {:.1f}, {} points, f {:.1f}, noise {:.3f}",
                pair.frame_a,
                pair.frame_b,
                NameOf(kStartMethodNames, start.method),
                start.cost,
                start.model.CountPoints(),
                start.model.camera().fx,
                start.model.noise());
}

}  // namespace

Start FindStart(const WhitenedTracks& whitened,
                const Camera& camera,
                const std::vector<FramePairMotion>& pairs) {
  constexpr std::size_t kMaxWindows = 6;  // a bound on time, tuned on the tuning clips
  Start start;
  std::vector<FramePairMotion> tried;
  for (const FramePairMotion& pair : pairs) {
    // A window much like one that failed would fail again.
    const bool similar = std::any_of(
        tried.begin(), tried.end(), [&](const auto& other) { return AreSimilar(other, pair); });
    if (similar) continue;
    if (tried.size() == kMaxWindows) break;
    tried.push_back(pair);
    std::vector<StartModel> models = BuildStartModels(whitened, camera, pair);
    for (const StartModel& model : models) LogStart(pair, model);
    if (models.empty()) continue;
    start.model = std::move(models.front());
    break;
  }
  start.windows_tried = tried.size();
  return start;
}

}  // namespace cohort
