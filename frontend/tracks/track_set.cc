#include "frontend/tracks/track_set.h"

#include <algorithm>
#include <cmath>

namespace cohort {

TrackSet TrackSet::Build(std::vector<Observation> observations, std::vector<TrackEnd> ends) {
  const auto key = [](const Observation& o) { return std::pair(o.feature, o.frame); };
  std::sort(observations.begin(), observations.end(), [&](const auto& a, const auto& b) {
    return key(a) < key(b);
  });
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const Observation& o = observations[i];
    if (!o.xy.allFinite()) {
      ThrowError("track {} has a position that is not finite in frame {}",
                 ToInt(o.feature),
                 ToInt(o.frame));
    }
    if (i > 0 && key(observations[i - 1]) == key(o)) {
      ThrowError("track {} has two positions in frame {}", ToInt(o.feature), ToInt(o.frame));
    }
  }
  std::sort(ends.begin(), ends.end(), [](const TrackEnd& a, const TrackEnd& b) {
    return a.feature < b.feature;
  });
  TrackSet set;
  set.observations_ = std::move(observations);
  set.ends_ = std::move(ends);
  set.Index();
  return set;
}

void TrackSet::Index() {
  features_.clear();
  first_of_feature_.clear();
  for (std::size_t i = 0; i < observations_.size(); ++i) {
    if (features_.empty() || features_.back() != observations_[i].feature) {
      features_.push_back(observations_[i].feature);
      first_of_feature_.push_back(i);
    }
  }
  first_of_feature_.push_back(observations_.size());

  by_frame_.resize(observations_.size());
  for (std::size_t i = 0; i < observations_.size(); ++i) by_frame_[i] = &observations_[i];
  // Stable, so that the features within a frame remain ascending.
  std::stable_sort(by_frame_.begin(), by_frame_.end(), [](const auto* a, const auto* b) {
    return a->frame < b->frame;
  });
  frames_.clear();
  first_of_frame_.clear();
  for (std::size_t i = 0; i < by_frame_.size(); ++i) {
    if (frames_.empty() || frames_.back() != by_frame_[i]->frame) {
      frames_.push_back(by_frame_[i]->frame);
      first_of_frame_.push_back(i);
    }
  }
  first_of_frame_.push_back(by_frame_.size());
}

TrackSet::TrackSet(const TrackSet& other) : observations_(other.observations_), ends_(other.ends_) {
  Index();
}

TrackSet& TrackSet::operator=(const TrackSet& other) {
  if (this != &other) *this = TrackSet(other);
  return *this;
}

std::span<const Observation> TrackSet::Track(FeatureId feature) const {
  const auto it = std::lower_bound(features_.begin(), features_.end(), feature);
  if (it == features_.end() || *it != feature) return {};
  const auto i = static_cast<std::size_t>(it - features_.begin());
  return std::span(observations_)
      .subspan(first_of_feature_[i], first_of_feature_[i + 1] - first_of_feature_[i]);
}

std::span<const Observation* const> TrackSet::InFrame(FrameIndex frame) const {
  const auto it = std::lower_bound(frames_.begin(), frames_.end(), frame);
  if (it == frames_.end() || *it != frame) return {};
  const auto i = static_cast<std::size_t>(it - frames_.begin());
  return std::span(by_frame_).subspan(first_of_frame_[i],
                                      first_of_frame_[i + 1] - first_of_frame_[i]);
}

const Observation* TrackSet::Find(FeatureId feature, FrameIndex frame) const {
  const auto track = Track(feature);
  const auto it = std::lower_bound(
      track.begin(), track.end(), frame, [](const auto& o, auto f) { return o.frame < f; });
  return it != track.end() && it->frame == frame ? &*it : nullptr;
}

std::size_t TrackSet::CountObserved(FrameIndex frame) const {
  const auto in_frame = InFrame(frame);
  return static_cast<std::size_t>(std::count_if(
      in_frame.begin(), in_frame.end(), [](const Observation* o) { return IsObserved(*o); }));
}

std::vector<double> TrackSet::MotionsPx(FrameIndex from, FrameIndex to) const {
  std::vector<double> motions;
  for (const Observation* o : InFrame(from)) {
    if (!IsObserved(*o)) continue;
    const Observation* const other = Find(o->feature, to);
    if (other != nullptr && IsObserved(*other)) motions.push_back((other->xy - o->xy).norm());
  }
  return motions;
}

std::size_t TrackSet::CountObserved() const {
  return static_cast<std::size_t>(
      std::count_if(observations_.begin(), observations_.end(), IsObserved));
}

double TrackSet::MeanObservedLength() const {
  if (features_.empty()) return 0.0;
  return static_cast<double>(CountObserved()) / static_cast<double>(features_.size());
}

}  // namespace cohort
