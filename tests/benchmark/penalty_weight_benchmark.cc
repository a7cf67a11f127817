// The search for m of eq. (7), and how much depends on it: the guide alone (no measurement), by the
// paper's L1 error after 30 frames, over a grid of m for each penalty and constraint, at three
// levels of darkness.   penalty_weight_benchmark CLIP... --work DIR [--svg FILE] [--jobs N]
// Errors are geometric means over clips and seeds, as multiples of the level's best m. The m to
// take is the one whose worst level is the least bad. What is finished in DIR is not done again.
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <tuple>
#include <vector>

#include "frontend/storage/output.h"
#include "pipelines/console/table.h"
#include "pipelines/experiment/collection.h"
#include "pipelines/experiment/experiment.h"
#include "pipelines/json/json_file.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

const std::vector<std::string> kLevels{"clean", "medium", "hard"};

// A penalty in one of its two strengths, and the m in the middle of the grid.
struct Case {
  PenaltyKind penalty;
  Constraint constraint;
  double middle;

  std::string Name() const {
    return fmt::format(
        "{}, {}", NameOf(kPenaltyNames, penalty), NameOf(kConstraintNames, constraint));
  }
};
const std::vector<Case> kCases{
    {PenaltyKind::kExplicitFactorization, Constraint::kWeak, 0.8},
    {PenaltyKind::kNuclearNorm, Constraint::kWeak, 0.6},
    {PenaltyKind::kEmpiricalDimension, Constraint::kWeak, 40.0},
    {PenaltyKind::kExplicitFactorization, Constraint::kStrong, 0.02},
    {PenaltyKind::kNuclearNorm, Constraint::kStrong, 0.015},
    {PenaltyKind::kEmpiricalDimension, Constraint::kStrong, 1.0},
};

// Quarter decades.
std::vector<double> Weights(double middle, int steps) {
  std::vector<double> weights;
  for (int i = -steps; i <= steps; ++i) weights.push_back(middle * std::pow(10.0, 0.25 * i));
  return weights;
}

struct Curves {
  std::vector<double> weights;
  std::map<std::string, std::vector<double>> errors;  // by level: multiples of the best

  double Worst(std::size_t i) const {
    double worst = 0.0;
    for (const auto& [level, values] : errors) worst = std::max(worst, values[i]);
    return worst;
  }
  std::size_t Choice() const {
    std::size_t best = 0;
    for (std::size_t i = 1; i < weights.size(); ++i) {
      if (Worst(i) < Worst(best)) best = i;
    }
    return best;
  }
};

std::string TrackerName(const Case& c, double weight) {
  return fmt::format("{}_{}_{:.3g}",
                     NameOf(kPenaltyNames, c.penalty),
                     NameOf(kConstraintNames, c.constraint),
                     weight);
}

std::vector<Curves> Run(ExperimentOptions options, const OptimizerKind optimizer, int steps) {
  const fs::path folder = fs::path(options.out) / "trackers";
  for (const Case& c : kCases) {
    for (const double weight : Weights(c.middle, steps)) {
      const fs::path file = folder / (TrackerName(c, weight) + ".json");
      fs::create_directories(folder);
      WriteJsonFile(file,
                    {{"tracker", "subspace"},
                     {"subspace",
                      {{"penalty", NameOf(kPenaltyNames, c.penalty)},
                       {"constraint", NameOf(kConstraintNames, c.constraint)},
                       {"optimizer", NameOf(kOptimizerNames, optimizer)},
                       {"penalty_weight", weight / CalibratedWeight(c.penalty, c.constraint)}}},
                     {"measurement", {{"enabled", false}}}});
      options.trackers.push_back(file.string());
    }
  }
  const ExperimentResults results = CollectResults(options, RunCells(options));
  std::map<std::pair<std::string, std::string>, std::vector<double>> logs;  // tracker, level
  for (const ResultRow& row : results.rows) {
    if (row.metric == kL1ErrorMetric) {
      logs[{row.tracker, row.level}].push_back(std::log(row.value));
    }
  }
  std::vector<Curves> all;
  for (const Case& c : kCases) {
    Curves curves{Weights(c.middle, steps), {}};
    for (const std::string& level : kLevels) {
      auto& errors = curves.errors[level];
      for (const double weight : curves.weights) {
        const auto& values = logs[{TrackerName(c, weight), level}];
        double sum = 0.0;
        for (const double value : values) sum += value;
        errors.push_back(values.empty() ? INFINITY
                                        : std::exp(sum / static_cast<double>(values.size())));
      }
      const double best = *std::min_element(errors.begin(), errors.end());
      fmt::print("{}, {}: {:.1f} px at best\n", c.Name(), level, best);
      for (double& error : errors) error /= best;
    }
    all.push_back(std::move(curves));
  }
  return all;
}

void Print(const std::vector<Curves>& all) {
  std::vector<std::vector<std::string>> table{
      {"penalty, constraint", "m", "clean", "medium", "hard", "worst", ""}};
  for (std::size_t k = 0; k < kCases.size(); ++k) {
    for (std::size_t i = 0; i < all[k].weights.size(); ++i) {
      std::vector<std::string> line{kCases[k].Name(), fmt::format("{:.3g}", all[k].weights[i])};
      for (const std::string& level : kLevels) {
        line.push_back(fmt::format("{:.3f}", all[k].errors.at(level)[i]));
      }
      line.push_back(fmt::format("{:.3f}", all[k].Worst(i)));
      line.push_back(i == all[k].Choice() ? "<-" : "");
      table.push_back(line);
    }
  }
  fmt::print("\n{}", AlignedTable(table));
}

// Small multiples: m to the right (logarithmic), the error as a multiple of the best upwards.
std::string Svg(const std::vector<Curves>& all) {
  constexpr double kWidth = 250, kHeight = 170, kLeft = 46, kTop = 44, kGapX = 30, kGapY = 66;
  constexpr double kMaxRatio = 2.0;
  const std::map<std::string, std::string> colors{
      {"clean", "#2a9d4a"}, {"medium", "#2060c0"}, {"hard", "#c03028"}};
  std::string svg = fmt::format(
      "<svg xmlns='http://www.w3.org/2000/svg' width='{0}' height='{1}' viewBox='0 0 {0} {1}' "
      "font-family='sans-serif' font-size='11'>\n<rect width='100%' height='100%' "
      "fill='white'/>\n",
      kLeft + 3 * (kWidth + kGapX),
      kTop + 2 * (kHeight + kGapY));
  double legend = kLeft;
  for (const std::string& level : kLevels) {
    svg += fmt::format("<text x='{}' y='16' fill='{}' font-weight='bold'>{}</text>\n",
                       legend,
                       colors.at(level),
                       level);
    legend += 60;
  }
  svg += fmt::format(
      "<text x='{}' y='16'>L1 error after 30 frames / that of the level's best m; dashed: +10 %, "
      "and the m chosen</text>\n",
      legend);
  for (std::size_t k = 0; k < all.size(); ++k) {
    const Curves& curves = all[k];
    const double x0 = kLeft + static_cast<double>(k % 3) * (kWidth + kGapX);
    const std::size_t row = k / 3;
    const double y0 = kTop + static_cast<double>(row) * (kHeight + kGapY);
    const double low = std::log10(curves.weights.front());
    const double high = std::log10(curves.weights.back());
    const auto x = [&](double m) { return x0 + kWidth * (std::log10(m) - low) / (high - low); };
    const auto y = [&](double ratio) {
      return y0 + kHeight * (kMaxRatio - std::min(ratio, kMaxRatio)) / (kMaxRatio - 1.0);
    };
    svg += fmt::format(
        "<text x='{:.1f}' y='{:.1f}' font-weight='bold'>{}: m = {:.2g}</text>\n<rect x='{}' y='{}' "
        "width='{}' "
        "height='{}' fill='none' stroke='#888'/>\n",
        x0,
        y0 - 6,
        kCases[k].Name(),
        curves.weights[curves.Choice()],
        x0,
        y0,
        kWidth,
        kHeight);
    for (const double ratio : {1.0, 1.5, 2.0}) {
      svg += fmt::format(
          "<text x='{:.1f}' y='{:.1f}' text-anchor='end'>{}</text>\n", x0 - 4, y(ratio) + 4, ratio);
    }
    for (double decade = std::ceil(low - 1e-9); decade <= high + 1e-9; decade += 1.0) {
      svg += fmt::format("<text x='{:.1f}' y='{:.1f}' text-anchor='middle'>{:g}</text>\n",
                         x(std::pow(10.0, decade)),
                         y0 + kHeight + 14,
                         std::pow(10.0, decade));
    }
    const auto dashed = [&](double x1, double y1, double x2, double y2) {
      svg += fmt::format(
          "<line x1='{:.1f}' y1='{:.1f}' x2='{:.1f}' y2='{:.1f}' stroke='#888' stroke-dasharray='4 "
          "3'/>\n",
          x1,
          y1,
          x2,
          y2);
    };
    dashed(x0, y(1.1), x0 + kWidth, y(1.1));
    const double chosen = curves.weights[curves.Choice()];
    dashed(x(chosen), y0, x(chosen), y0 + kHeight);
    for (const std::string& level : kLevels) {
      std::string points;
      for (std::size_t i = 0; i < curves.weights.size(); ++i) {
        points +=
            fmt::format("{:.1f},{:.1f} ", x(curves.weights[i]), y(curves.errors.at(level)[i]));
      }
      svg += fmt::format("<polyline points='{}' fill='none' stroke='{}' stroke-width='2'/>\n",
                         points,
                         colors.at(level));
    }
    svg += fmt::format("<text x='{:.1f}' y='{:.1f}' text-anchor='middle'>m</text>\n",
                       x0 + kWidth / 2,
                       y0 + kHeight + 28);
  }
  return svg + "</svg>\n";
}

}  // namespace
}  // namespace cohort

int main(int argc, char** argv) {
  CLI::App app("How much depends on the weight of the penalty");
  cohort::ExperimentOptions options;
  options.protocol = cohort::Protocol::kPaper;
  options.trackers.clear();
  options.levels = cohort::kLevels;
  options.frames = "0:31";
  options.resume = true;
  std::string svg;
  int steps = 5;
  bool algorithm_1 = false;
  app.add_option("clips", options.inputs, "clips of `cohort synth`")->required();
  app.add_option("--work", options.out, "folder for what is run")->required();
  app.add_option("--svg", svg, "file for the curves");
  app.add_option("--seeds", options.seeds, "of the noise")->delimiter(',');
  app.add_option("--jobs", options.jobs, "processes at a time");
  app.add_option("--steps", steps, "quarter decades of m to either side")->check(CLI::Range(1, 20));
  app.add_flag("--algorithm-1", algorithm_1, "the paper's optimiser");
  CLI11_PARSE(app, argc, argv);
  try {
    const auto optimizer =
        algorithm_1 ? cohort::OptimizerKind::kAlgorithm1 : cohort::SubspaceOptions().optimizer;
    const auto curves = cohort::Run(options, optimizer, steps);
    cohort::Print(curves);
    if (!svg.empty()) {
      cohort::OutputFile file(svg);
      cohort::WriteBytes(file.partial(), cohort::Svg(curves));
      file.Commit();
    }
  } catch (const std::exception& e) {
    fmt::print(stderr, "error: {}\n", e.what());
    return 1;
  }
  return 0;
}
