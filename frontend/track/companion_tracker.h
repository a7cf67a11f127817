#pragma once

#include <memory>

#include "frontend/track/tracker.h"

namespace cohort {

// Ids from here on are the companion's.
inline constexpr FeatureId kFirstCompanion{1U << 30U};

// Two trackers beside each other on the same frames: what one loses, the other may hold. Their
// features know nothing of each other; JoinCompanions (frontend/tracks/companions.h) makes one set
// of both.
class CompanionTracker final : public Tracker {
 public:
  CompanionTracker(std::unique_ptr<Tracker> tracker, std::unique_ptr<Tracker> companion)
      : tracker_(std::move(tracker)), companion_(std::move(companion)) {}

  FrameResult Track(const Frame& frame) override;

 private:
  std::unique_ptr<Tracker> tracker_;
  std::unique_ptr<Tracker> companion_;
};

}  // namespace cohort
