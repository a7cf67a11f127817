#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <span>

#include "frontend/image/pyramid.h"
#include "frontend/track/subspace/subspace_options.h"

namespace cohort {

// Finds where the features probably are in a new picture. Each of them is measured from there.
//
//   guide.Begin(picture); guide.Add(born, picture);
//   for each frame: start = guide.Find(picture, confirmed); guide.Remember(picture, x, confirmed);
//  with `confirmed[f]` != 0 if the image confirmed feature f: in the last frame for Find, in this
// one for Remember. Positions are 2 x F [px].
class Guide {
 public:
  virtual ~Guide() = default;

  // Removes all features; the window starts with this picture.
  virtual void Begin(const Pyramid& picture) = 0;
  // Appends features that were born at these positions in the newest picture.
  virtual void Add(std::span<const Eigen::Vector2d> born, const Pyramid& picture) = 0;
  // Removes the features with keep[f] == 0.
  virtual void Keep(std::span<const std::uint8_t> keep) = 0;

  // In the newest picture.
  virtual const Eigen::Matrix2Xd& positions() const = 0;
  virtual Eigen::Matrix2Xd Find(const Pyramid& current,
                                std::span<const std::uint8_t> confirmed) const = 0;
  // `x`: where the features turned out to be.
  virtual void Remember(const Pyramid& current,
                        const Eigen::Matrix2Xd& x,
                        std::span<const std::uint8_t> confirmed) = 0;
};

// Lucas-Kanade for each feature without a penalty, otherwise the paper's joint guide.
std::unique_ptr<Guide> MakeGuide(const SubspaceOptions& options);

}  // namespace cohort
