#include "frontend/track/subspace/lucas_kanade_guide.h"

#include <optional>
#include <vector>

#include "frontend/core/in_parallel.h"
#include "frontend/core/part_times.h"
#include "frontend/image/frame_offset.h"
#include "frontend/track/measure/measurement.h"

namespace cohort {

void LucasKanadeGuide::Begin(const Pyramid& picture) {
  previous_ = picture;
  x_.resize(2, 0);
}

void LucasKanadeGuide::Add(std::span<const Eigen::Vector2d> born, const Pyramid& /*picture*/) {
  const Eigen::Index old = x_.cols();
  x_.conservativeResize(2, old + static_cast<Eigen::Index>(born.size()));
  for (std::size_t i = 0; i < born.size(); ++i) {
    x_.col(old + static_cast<Eigen::Index>(i)) = born[i];
  }
}

Eigen::Matrix2Xd LucasKanadeGuide::Find(const Pyramid& current,
                                        std::span<const std::uint8_t> confirmed) const {
  const TimedPart part("guide");
  // The wider of the windows that KLT is compared with. 21 px lose a drive at three times its
  // speed.
  constexpr int kWindowPx = 31;
  // The anchor says where exactly the feature is. Full resolution would mislead: a compressed video
  // repeats blocks of the last frame.
  constexpr int kFinestLevel = 2;
  const Eigen::Vector2d shift = RegisterFrames(previous_, current);
  std::vector<std::optional<Eigen::Vector2d>> found(confirmed.size());
  ForEachInParallel(confirmed.size(), [&](std::size_t f) {
    if (confirmed[f] == 0) return;
    const Eigen::Vector2d xy = x_.col(static_cast<Eigen::Index>(f));
    found[f] = TrackWindow(previous_, current, xy, xy + shift, kWindowPx, kFinestLevel);
  });
  Eigen::Matrix2Xd x = x_.colwise() + shift;
  for (std::size_t f = 0; f < found.size(); ++f) {
    if (found[f]) x.col(static_cast<Eigen::Index>(f)) = *found[f];
  }
  return x;
}

void LucasKanadeGuide::Remember(const Pyramid& current,
                                const Eigen::Matrix2Xd& x,
                                std::span<const std::uint8_t> /*confirmed*/) {
  previous_ = current;
  x_ = x;
}

}  // namespace cohort
