#include "backend/scene/whitened_tracks.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <map>
#include <vector>

#include "frontend/core/statistics.h"

namespace cohort {
namespace {

Eigen::Matrix2d ObservationCovariance(const Observation& observation,
                                      const WhiteningOptions& options) {
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();
  if (options.use_covariances && observation.covariance) {
    const double floor = options.covariance_floor_px * options.covariance_floor_px;
    const Eigen::Matrix2d measured =
        observation.covariance->Matrix() + floor * Eigen::Matrix2d::Identity();
    if (measured.allFinite() && measured(0, 0) > 0.0 && measured.determinant() > 0.0) {
      covariance = measured;
    }
  }
  return covariance;
}

}  // namespace

WhitenedTracks::WhitenedTracks(const TrackFile& file, const WhiteningOptions& options)
    : frames_(file.frames), frame_times_(CaptureTimes(file)) {
  std::map<FrameIndex, int> frame_number;
  for (int i = 0; i < frame_count(); ++i) frame_number[frames_[i].index] = i;
  for (const FrameIndex frame : file.tracks.frames()) {
    if (!frame_number.contains(frame)) {
      ThrowError("the tracks name frame {}, which is not in their list of frames", ToInt(frame));
    }
  }
  in_frame_.resize(frames_.size());
  for (const FeatureId feature : file.tracks.features()) {
    const auto track = file.tracks.Track(feature);
    if (std::count_if(track.begin(), track.end(), IsObserved) < options.min_track_length) continue;
    const int number = track_count();
    features_.push_back(feature);
    first_of_track_.push_back(static_cast<int>(observations_.size()));
    for (const Observation& o : track) {
      if (!IsObserved(o)) continue;
      WhitenedObservation& observation = observations_.emplace_back();
      observation.frame = frame_number.at(o.frame);
      observation.track = number;
      observation.xy = o.xy;
      observation.covariance_px2 = ObservationCovariance(o, options);
      observation.whitening = Eigen::LLT<Eigen::Matrix2d>(observation.covariance_px2)
                                  .matrixL()
                                  .solve(Eigen::Matrix2d::Identity());
      in_frame_[observation.frame].push_back(static_cast<int>(observations_.size()) - 1);
    }
  }
  first_of_track_.push_back(static_cast<int>(observations_.size()));
}

WhitenedTracks WhitenedTracks::WithPositions(const std::vector<Eigen::Vector2d>& xy) const {
  Check(xy.size() == observations_.size(), "every observation has a position");
  WhitenedTracks moved(*this);
  for (std::size_t i = 0; i < xy.size(); ++i) moved.observations_[i].xy = xy[i];
  return moved;
}

WhitenedTracks WhitenedTracks::Select(const std::vector<int>& tracks) const {
  WhitenedTracks selected;
  selected.frames_ = frames_;
  selected.frame_times_ = frame_times_;
  selected.in_frame_.resize(frames_.size());
  for (const int track : tracks) {
    const auto [first, last] = TrackRange(track);
    selected.first_of_track_.push_back(static_cast<int>(selected.observations_.size()));
    for (int o = first; o < last; ++o) {
      selected.in_frame_[observations_[o].frame].push_back(
          static_cast<int>(selected.observations_.size()));
      selected.observations_.push_back(observations_[o]);
      selected.observations_.back().track = selected.track_count();
    }
    selected.features_.push_back(features_[track]);
  }
  selected.first_of_track_.push_back(static_cast<int>(selected.observations_.size()));
  return selected;
}

std::pair<int, int> WhitenedTracks::RangeWithin(int track, int first, int last) const {
  const auto [begin, end] = TrackRange(track);
  const auto from = std::lower_bound(observations_.begin() + begin,
                                     observations_.begin() + end,
                                     first,
                                     [](const auto& o, int frame) { return o.frame < frame; });
  const auto to =
      std::upper_bound(from, observations_.begin() + end, last, [](int frame, const auto& o) {
        return frame < o.frame;
      });
  return {static_cast<int>(from - observations_.begin()),
          static_cast<int>(to - observations_.begin())};
}

std::optional<int> WhitenedTracks::FindObservation(int track, int frame) const {
  const auto [first, last] = TrackRange(track);
  // Most tracks have no gaps, so the index is known.
  const int guess = first + frame - observations_[first].frame;
  if (guess >= first && guess < last && observations_[guess].frame == frame) return guess;
  const auto begin = observations_.begin() + first;
  const auto end = observations_.begin() + last;
  const auto it =
      std::lower_bound(begin, end, frame, [](const auto& o, int f) { return o.frame < f; });
  if (it == end || it->frame != frame) return std::nullopt;
  return static_cast<int>(it - observations_.begin());
}

std::vector<std::pair<int, int>> WhitenedTracks::CommonObservations(int frame_a,
                                                                    int frame_b) const {
  std::vector<std::pair<int, int>> result;
  for (const int a : in_frame_[frame_a]) {
    if (const auto b = FindObservation(observations_[a].track, frame_b)) result.emplace_back(a, *b);
  }
  return result;
}

bool WhitenedTracks::HasSeam() const {
  constexpr double kWeak = 0.5;
  std::vector<double> shared;
  for (int frame = 1; frame < frame_count(); ++frame) {
    shared.push_back(static_cast<double>(CommonObservations(frame - 1, frame).size()));
  }
  return !shared.empty() &&
         *std::min_element(shared.begin(), shared.end()) < kWeak * Median(shared);
}

}  // namespace cohort
