#pragma once

#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "pipelines/experiment/results.h"

namespace cohort {

// Metrics that the headline compares, as results.csv names them.
inline constexpr const char* kCameraErrorMetric = "ate";
inline constexpr const char* kPointErrorMetric = "point_error_median";
inline constexpr const char* kTrackLengthMetric = "mean_track_length";

// One tracker's reconstruction of one clip at one level, over all seeds.
struct ResultCell {
  std::string sequence;
  std::string level;
  std::string tracker;
  std::string backend;
};

// Results by cell and metric, with names in their order of appearance.
class ResultIndex {
 public:
  explicit ResultIndex(const ExperimentResults& results);

  const std::vector<std::string>& sequences() const { return sequences_; }
  const std::vector<std::string>& levels() const { return levels_; }
  const std::vector<std::string>& trackers() const { return trackers_; }
  const std::vector<std::string>& backends() const { return backends_; }

  // By seed. The track length is the tracker's, whatever the cell's backend.
  const std::map<unsigned, double>& Values(const ResultCell& cell, const std::string& metric) const;

  bool Ran(const ResultCell& cell) const;
  // Whether so many seeds failed, in reconstruction or tracking, that the median error is infinite.
  bool Failed(const ResultCell& cell) const;
  // Over seeds; nullopt if the cell failed or has no such figure. A failed seed has an infinite
  // error; otherwise trackers that fail on hard clips would have the small medians.
  std::optional<double> Median(const ResultCell& cell, const std::string& metric) const;
  // Over the frames of all seeds; a failed one counts with what it registered.
  std::optional<double> RegisteredShare(const ResultCell& cell) const;

 private:
  using Key = std::tuple<std::string, std::string, std::string, std::string, std::string>;

  std::map<Key, std::map<unsigned, double>> values_;
  std::vector<std::string> sequences_;
  std::vector<std::string> levels_;
  std::vector<std::string> trackers_;
  std::vector<std::string> backends_;
};

}  // namespace cohort
