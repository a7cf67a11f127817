#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>

#include "frontend/core/options.h"

namespace cohort {

// Ids are types, so that a swapped (feature, frame) does not compile. A FrameIndex counts the
// frames of the source from 0, before any --frames range or stride, and thus identifies ground
// truth and time stamps.
enum class FeatureId : std::uint32_t {};
enum class FrameIndex : std::uint32_t {};

constexpr std::uint32_t ToInt(FeatureId id) { return static_cast<std::uint32_t>(id); }
constexpr std::uint32_t ToInt(FrameIndex index) { return static_cast<std::uint32_t>(index); }

enum class ObservationState : std::uint8_t {
  kObserved,   // the image of this frame confirms the position
  kPredicted,  // held by the penalty (the other features) alone
};

// Why a track ended.
enum class LossReason : std::uint8_t {
  kLeftImage,     // its patch left the image
  kContradicted,  // the image contradicted it, or did not confirm it, for too long
  kDiverged,      // the tracker failed on it (no texture, forward-backward check)
  kMasked,        // it entered the mask
  kCut,           // the clip was cut: another scene follows
};
inline constexpr ChoiceNames<LossReason, 5> kLossReasonNames{
    {{"left_image", LossReason::kLeftImage},
     {"contradicted", LossReason::kContradicted},
     {"diverged", LossReason::kDiverged},
     {"masked", LossReason::kMasked},
     {"cut", LossReason::kCut}}};

// Symmetric 2x2 covariance of a measured position [px^2].
struct PixelCovariance {
  float xx = 1.0F;
  float xy = 0.0F;
  float yy = 1.0F;

  // Whether the entries form a positive definite matrix in floats; readers of files check it.
  static bool IsOne(double xx, double xy, double yy) {
    using Limits = std::numeric_limits<float>;
    const auto is_variance = [](double v) { return v >= Limits::min() && v <= Limits::max(); };
    return is_variance(xx) && is_variance(yy) && xx * yy > xy * xy;
  }

  // If rounding makes a very long ellipse singular (xx yy = xy^2), xy is reduced slightly.
  static PixelCovariance From(const Eigen::Matrix2d& matrix) {
    PixelCovariance c{static_cast<float>(matrix(0, 0)),
                      static_cast<float>(matrix(0, 1)),
                      static_cast<float>(matrix(1, 1))};
    if (IsOne(c.xx, 0.0, c.yy) && std::isfinite(c.xy) && !IsOne(c.xx, c.xy, c.yy)) {
      constexpr double kLess = 1.0 - 1e-6;
      const double most = kLess * std::sqrt(double{c.xx} * double{c.yy});
      c.xy = static_cast<float>(std::copysign(most, matrix(0, 1)));
    }
    return c;
  }
  Eigen::Matrix2d Matrix() const {
    Eigen::Matrix2d matrix;
    matrix << xx, xy, xy, yy;
    return matrix;
  }
};

// Where a feature was in a frame. xy in pixels, the centre of the top-left pixel is (0, 0).
struct Observation {
  FeatureId feature{};
  FrameIndex frame{};
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();
  ObservationState state = ObservationState::kObserved;
  double residual = 0.0;  // mean absolute difference to the template, intensities 0..1
  // The covariance of xy, if the measurement step gives one.
  std::optional<PixelCovariance> covariance = std::nullopt;
};

inline bool IsObserved(const Observation& o) { return o.state == ObservationState::kObserved; }

}  // namespace cohort
