#pragma once

#include "frontend/core/keep.h"
#include "frontend/track/subspace/guide.h"

namespace cohort {

// Finds each feature where Lucas-Kanade, which starts at the shift of the whole picture, finds the
// window around its last position. A feature that was not confirmed there, or that is not found,
// moves with the whole picture.
class LucasKanadeGuide final : public Guide {
 public:
  void Begin(const Pyramid& picture) override;
  void Add(std::span<const Eigen::Vector2d> born, const Pyramid& picture) override;
  void Keep(std::span<const std::uint8_t> keep) override { KeepOnly(keep, x_); }

  const Eigen::Matrix2Xd& positions() const override { return x_; }
  Eigen::Matrix2Xd Find(const Pyramid& current,
                        std::span<const std::uint8_t> confirmed) const override;
  void Remember(const Pyramid& current,
                const Eigen::Matrix2Xd& x,
                std::span<const std::uint8_t> confirmed) override;

 private:
  Pyramid previous_;
  Eigen::Matrix2Xd x_{2, 0};  // in the previous picture
};

}  // namespace cohort
