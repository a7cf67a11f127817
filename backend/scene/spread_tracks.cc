#include "backend/scene/spread_tracks.h"

#include <algorithm>
#include <numeric>

namespace cohort {

std::vector<int> SpreadTracks(const WhitenedTracks& whitened,
                              const Camera& camera,
                              const std::vector<int>& frames,
                              int per_cell) {
  constexpr int kColumns = 8;
  constexpr int kRows = 6;
  std::vector<int> place(whitened.frame_count(), -1);  // of the frame's cells in `count`
  for (std::size_t i = 0; i < frames.size(); ++i) {
    place[frames[i]] = static_cast<int>(i) * kColumns * kRows;
  }
  std::vector<int> count(frames.size() * kColumns * kRows, 0);
  const auto length = [&](int track) {
    const auto [first, last] = whitened.TrackRange(track);
    return last - first;
  };
  std::vector<int> by_length(whitened.track_count());
  std::iota(by_length.begin(), by_length.end(), 0);
  std::stable_sort(
      by_length.begin(), by_length.end(), [&](int a, int b) { return length(a) > length(b); });
  std::vector<int> tracks;
  std::vector<int> cells;
  for (const int track : by_length) {
    cells.clear();
    const auto [first, last] = whitened.TrackRange(track);
    for (int o = first; o < last; ++o) {
      const WhitenedObservation& observation = whitened.observations()[o];
      if (place[observation.frame] < 0) continue;
      // Predicted positions may lie anywhere.
      const auto cell = [](double share, int cells) {
        return static_cast<int>(std::clamp(cells * share, 0.0, cells - 1.0));
      };
      cells.push_back(place[observation.frame] +
                      cell(observation.xy.y() / camera.height_px, kRows) * kColumns +
                      cell(observation.xy.x() / camera.width_px, kColumns));
    }
    if (std::none_of(cells.begin(), cells.end(), [&](int c) { return count[c] < per_cell; })) {
      continue;
    }
    for (const int cell : cells) ++count[cell];
    tracks.push_back(track);
  }
  std::sort(tracks.begin(), tracks.end());
  return tracks;
}

}  // namespace cohort
