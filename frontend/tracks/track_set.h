#pragma once

#include <map>
#include <span>
#include <utility>
#include <vector>

#include "frontend/tracks/observation.h"

namespace cohort {

struct TrackEnd {
  FeatureId feature{};
  FrameIndex last_frame{};  // the last frame that has an observation of it
  LossReason reason = LossReason::kLeftImage;
};

// All tracks of a clip, immutable and sorted by (feature, frame). It is the only data that passes
// from the frontend to the backend.
class TrackSet {
 public:
  TrackSet() = default;

  // Sorts. Throws Error naming the feature and frame of a duplicate or a non-finite xy.
  static TrackSet Build(std::vector<Observation> observations, std::vector<TrackEnd> ends = {});

  std::span<const Observation> observations() const { return observations_; }
  std::span<const FeatureId> features() const { return features_; }  // ascending
  std::span<const FrameIndex> frames() const { return frames_; }  // ascending, with an observation

  // The observations of one feature, ascending frames; empty if it is unknown.
  std::span<const Observation> Track(FeatureId feature) const;
  // The observations of one frame, ascending features; empty if it is unknown.
  std::span<const Observation* const> InFrame(FrameIndex frame) const;
  // Null if the feature has no observation in this frame.
  const Observation* Find(FeatureId feature, FrameIndex frame) const;

  std::size_t CountObserved(FrameIndex frame) const;
  // How far the features that both frames observed moved in between [px], ascending features.
  std::vector<double> MotionsPx(FrameIndex from, FrameIndex to) const;

  // Why tracks ended, ascending features; tracks alive at the end of the clip are not listed.
  std::span<const TrackEnd> ends() const { return ends_; }

  // The tracks for which keep(FeatureId) is true, with their ends.
  template <typename Keep>
  TrackSet Select(const Keep& keep) const;

  std::size_t CountObserved() const;
  std::size_t CountPredicted() const { return observations_.size() - CountObserved(); }
  // Mean over features of their number of *observed* observations; 0 without features.
  double MeanObservedLength() const;

 private:
  std::vector<Observation> observations_;
  std::vector<FeatureId> features_;
  std::vector<std::size_t> first_of_feature_;  // features_.size() + 1 entries into observations_
  std::vector<FrameIndex> frames_;
  std::vector<std::size_t> first_of_frame_;   // frames_.size() + 1 entries into by_frame_
  std::vector<const Observation*> by_frame_;  // pointers into observations_' heap block
  std::vector<TrackEnd> ends_;

 public:
  // by_frame_ points into observations_: a move keeps the block, a copy must rebuild the pointers.
  TrackSet(const TrackSet& other);
  TrackSet& operator=(const TrackSet& other);
  TrackSet(TrackSet&&) noexcept = default;
  TrackSet& operator=(TrackSet&&) noexcept = default;
  ~TrackSet() = default;

 private:
  void Index();
};

template <typename Keep>
TrackSet TrackSet::Select(const Keep& keep) const {
  std::vector<Observation> observations;
  for (const Observation& o : observations_) {
    if (keep(o.feature)) observations.push_back(o);
  }
  std::vector<TrackEnd> ends;
  for (const TrackEnd& end : ends_) {
    if (keep(end.feature)) ends.push_back(end);
  }
  return Build(std::move(observations), std::move(ends));
}

}  // namespace cohort
