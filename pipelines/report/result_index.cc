#include "pipelines/report/result_index.h"

#include <algorithm>
#include <limits>

#include "frontend/core/statistics.h"

namespace cohort {
namespace {

void AddOnce(const std::string& name, std::vector<std::string>& names) {
  if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
}

}  // namespace

ResultIndex::ResultIndex(const ExperimentResults& results) {
  for (const ResultRow& row : results.rows) {
    values_[{row.sequence, row.level, row.tracker, row.backend, row.metric}][row.seed] = row.value;
    AddOnce(row.sequence, sequences_);
    AddOnce(row.level, levels_);
    AddOnce(row.tracker, trackers_);
    if (!row.backend.empty()) AddOnce(row.backend, backends_);
  }
}

const std::map<unsigned, double>& ResultIndex::Values(const ResultCell& cell,
                                                      const std::string& metric) const {
  static const std::map<unsigned, double> kNone;
  const std::string backend = metric == kTrackLengthMetric ? "" : cell.backend;
  const auto it = values_.find({cell.sequence, cell.level, cell.tracker, backend, metric});
  return it == values_.end() ? kNone : it->second;
}

bool ResultIndex::Ran(const ResultCell& cell) const { return !Values(cell, "failed").empty(); }

bool ResultIndex::Failed(const ResultCell& cell) const {
  const auto& failed = Values(cell, "failed");
  const auto failures = std::count_if(
      failed.begin(), failed.end(), [](const auto& seed) { return seed.second != 0.0; });
  return failures > 0 && 2 * failures >= static_cast<std::ptrdiff_t>(failed.size());
}

std::optional<double> ResultIndex::Median(const ResultCell& cell, const std::string& metric) const {
  if (Failed(cell)) return std::nullopt;
  std::vector<double> values;
  for (const auto& [seed, value] : Values(cell, metric)) values.push_back(value);
  if (values.empty()) return std::nullopt;
  if (metric != kTrackLengthMetric) {
    for (const auto& [seed, failed] : Values(cell, "failed")) {
      if (failed != 0.0) values.push_back(std::numeric_limits<double>::infinity());
    }
  }
  return InterpolatedMedian(std::move(values));
}

std::optional<double> ResultIndex::RegisteredShare(const ResultCell& cell) const {
  if (!Ran(cell)) return std::nullopt;
  const auto& frames = Values(cell, "frames");
  double sum = 0.0;
  for (const auto& [seed, count] : Values(cell, "registered")) {
    const auto it = frames.find(seed);
    if (it != frames.end() && it->second > 0.0) sum += count / it->second;
  }
  return sum / static_cast<double>(Values(cell, "failed").size());
}

}  // namespace cohort
