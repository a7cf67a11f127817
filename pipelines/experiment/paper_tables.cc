#include "pipelines/experiment/paper_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <tuple>

#include "frontend/core/statistics.h"
#include "pipelines/console/table.h"
#include "pipelines/experiment/named_trackers.h"

namespace cohort {
namespace {

void AppendNew(std::vector<std::string>& names, const std::string& name) {
  if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
}

// One metric of one level: [tracker][sequence] = {seed, value}.
struct Grid {
  std::vector<std::string> trackers;
  std::vector<std::string> sequences;
  std::map<std::pair<std::string, std::string>, std::map<unsigned, double>> cells;

  const std::map<unsigned, double>* Cell(const std::string& tracker,
                                         const std::string& sequence) const {
    const auto it = cells.find({tracker, sequence});
    return it == cells.end() ? nullptr : &it->second;
  }
};

// A cell with a failed seed has failed and is left out.
Grid GridOf(const ExperimentResults& results, const std::string& level, const std::string& metric) {
  Grid grid;
  std::set<std::pair<std::string, std::string>> failed;
  for (const ResultRow& row : results.rows) {
    if (row.level != level) continue;
    AppendNew(grid.trackers, row.tracker);
    AppendNew(grid.sequences, row.sequence);
    if (row.metric == metric) grid.cells[{row.tracker, row.sequence}][row.seed] = row.value;
    if (row.metric == "failed" && row.value != 0.0) failed.emplace(row.tracker, row.sequence);
  }
  for (const auto& cell : failed) grid.cells.erase(cell);
  return grid;
}

std::optional<double> MedianOf(const std::map<unsigned, double>* cell) {
  if (cell == nullptr) return std::nullopt;
  std::vector<double> values;
  for (const auto& [seed, value] : *cell) values.push_back(value);
  return InterpolatedMedian(std::move(values));
}

// The average over all sequences; nullopt if one is missing.
std::optional<double> Average(const Grid& grid, const std::string& tracker) {
  double sum = 0.0;
  for (const std::string& sequence : grid.sequences) {
    const auto median = MedianOf(grid.Cell(tracker, sequence));
    if (!median) return std::nullopt;
    sum += *median;
  }
  return sum / static_cast<double>(grid.sequences.size());
}

std::string Text(const std::optional<double>& value, int decimals) {
  return value ? fmt::format("{:.{}f}", *value, decimals) : "FAILED";
}

std::vector<std::string> Header(const Grid& grid) {
  std::vector<std::string> header{"tracker"};
  header.insert(header.end(), grid.sequences.begin(), grid.sequences.end());
  header.push_back("average");
  return header;
}

std::string FigureTable(const Grid& grid, const Grid& reinitializations) {
  std::vector<std::vector<std::string>> table{Header(grid)};
  for (const std::string& tracker : grid.trackers) {
    std::vector<std::string> line{tracker};
    for (const std::string& sequence : grid.sequences) {
      const auto* cell = grid.Cell(tracker, sequence);
      std::string text = Text(MedianOf(cell), 1);
      if (MedianOf(reinitializations.Cell(tracker, sequence)) == 0.0)
        text = fmt::format(">{}", text);
      if (cell != nullptr && cell->size() > 1) {
        const auto [low, high] = std::minmax_element(
            cell->begin(), cell->end(), [](auto& a, auto& b) { return a.second < b.second; });
        text += fmt::format(" ({:.0f}-{:.0f})", low->second, high->second);
      }
      line.push_back(text);
    }
    line.push_back(Text(Average(grid, tracker), 1));
    table.push_back(line);
  }
  return AlignedTable(table);
}

// Adds the tracker "klt, best window": for each sequence the one with the best median.
void AddBestKlt(Grid& grid, bool high_is_good) {
  std::vector<std::string> windows;
  for (const std::string& tracker : grid.trackers) {
    if (IsOfFamily(tracker, "klt")) windows.push_back(tracker);
  }
  if (windows.size() < 2) return;
  const std::string name = "klt, best window";
  for (const std::string& sequence : grid.sequences) {
    const std::map<unsigned, double>* best = nullptr;
    for (const std::string& tracker : windows) {
      const auto* cell = grid.Cell(tracker, sequence);
      if (cell == nullptr) continue;
      if (best == nullptr || (*MedianOf(cell) > *MedianOf(best)) == high_is_good) best = cell;
    }
    if (best != nullptr) grid.cells[{name, sequence}] = *best;
  }
  grid.trackers.push_back(name);
}

std::string RatioTable(Grid grid, const std::string& our_tracker, bool high_is_good) {
  AddBestKlt(grid, high_is_good);
  std::vector<std::vector<std::string>> table{Header(grid)};
  const auto ratio = [&](double ours, double other) {
    return high_is_good ? ours / other : other / ours;
  };
  for (const std::string& tracker : grid.trackers) {
    if (tracker == our_tracker) continue;
    std::vector<std::string> line{tracker};
    for (const std::string& sequence : grid.sequences) {
      const auto* other = grid.Cell(tracker, sequence);
      const auto* ours = grid.Cell(our_tracker, sequence);
      std::vector<double> ratios;
      for (const auto& [seed, value] : other == nullptr ? std::map<unsigned, double>() : *other) {
        if (ours == nullptr || !ours->contains(seed)) continue;
        ratios.push_back(ratio(ours->at(seed), value));
      }
      line.push_back(ratios.empty() ? "-"
                                    : fmt::format("{:.2f}", InterpolatedMedian(std::move(ratios))));
    }
    const auto other = Average(grid, tracker);
    const auto ours = Average(grid, our_tracker);
    line.push_back(other && ours ? fmt::format("{:.2f}", ratio(*ours, *other)) : "-");
    table.push_back(line);
  }
  return AlignedTable(table);
}

}  // namespace

std::optional<double> AverageOf(const ExperimentResults& results,
                                const std::string& level,
                                const std::string& metric,
                                const std::string& tracker,
                                const std::vector<std::string>& sequences) {
  Grid grid = GridOf(results, level, metric);
  if (!sequences.empty()) grid.sequences = sequences;
  if (grid.sequences.empty()) return std::nullopt;
  return Average(grid, tracker);
}

std::optional<double> RatioOfAverages(const ExperimentResults& results,
                                      const std::string& level,
                                      const std::string& metric,
                                      const std::string& a,
                                      const std::string& b) {
  const auto average_a = AverageOf(results, level, metric, a);
  const auto average_b = AverageOf(results, level, metric, b);
  if (!average_a || !average_b) return std::nullopt;
  return *average_a / *average_b;
}

int SequencesWon(const ExperimentResults& results,
                 const std::string& level,
                 const std::string& tracker,
                 const std::vector<std::string>& others) {
  const Grid grid = GridOf(results, level, kL1ErrorMetric);
  int won = 0;
  for (const std::string& sequence : grid.sequences) {
    const auto own = MedianOf(grid.Cell(tracker, sequence));
    won += own && std::all_of(others.begin(), others.end(), [&](const std::string& other) {
             const auto error = MedianOf(grid.Cell(other, sequence));
             return !error || *own < *error;
           });
  }
  return won;
}

std::string PaperTables(const ExperimentResults& results, int window_frames) {
  std::vector<std::string> levels;
  for (const ResultRow& row : results.rows) AppendNew(levels, row.level);
  std::string text;
  for (const std::string& level : levels) {
    const Grid l1 = GridOf(results, level, L1ErrorMetric(window_frames));
    const Grid life = GridOf(results, level, kFramesBetweenMetric);
    const Grid reinitializations = GridOf(results, level, "reinitializations");
    text += fmt::format("{}: mean L1 trajectory error after {} frames [px], lower is better\n{}\n",
                        level,
                        window_frames,
                        FigureTable(l1, {}));
    text += fmt::format("{}: mean frames between re-initialisations, higher is better\n{}\n",
                        level,
                        FigureTable(life, reinitializations));
    const std::string ours = "subspace";
    if (std::ranges::find(l1.trackers, ours) == l1.trackers.end()) continue;
    text +=
        fmt::format("{}: L1 error, tracker / {}\n{}\n", level, ours, RatioTable(l1, ours, false));
    text += fmt::format("{}: frames between re-initialisations, {} / tracker\n{}\n",
                        level,
                        ours,
                        RatioTable(life, ours, true));
  }
  return text;
}

}  // namespace cohort
