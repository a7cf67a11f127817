#pragma once

#include <memory>

#include "frontend/image/exposure.h"
#include "frontend/track/tracker.h"

namespace cohort {

// Equalises the light of all frames (Exposure) before it passes them to a tracker.
class SteadyLightTracker final : public Tracker {
 public:
  explicit SteadyLightTracker(std::unique_ptr<Tracker> tracker) : tracker_(std::move(tracker)) {}

  FrameResult Track(const Frame& frame) override;

 private:
  std::unique_ptr<Tracker> tracker_;
  Exposure exposure_;
};

}  // namespace cohort
