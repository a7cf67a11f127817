#include "pipelines/report/calibration_histograms.h"

#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "frontend/core/statistics.h"
#include "pipelines/json/json_file.h"

namespace cohort {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

Json CalibrationHistogramsToJson(const ExperimentResults& results) {
  struct Sum {
    std::vector<std::size_t> histogram;
    double sigmas = 0.0;
    std::size_t numbers = 0;
    std::vector<double> nees_ratios;
  };
  std::vector<std::pair<std::string, std::string>> order;
  std::map<std::pair<std::string, std::string>, Sum> sums;
  for (const TrackCell& cell : results.cells) {
    const fs::path file = cell.TrackErrors();
    if (!cell.is_tracked || !fs::exists(file)) continue;
    UseJsonFile(file, [&](const Json& errors) {
      if (!errors.contains("calibration") || errors.at("calibration").is_null()) return;
      const Json& calibration = errors.at("calibration");
      const std::pair key(cell.condition.level, cell.tracker.name);
      if (!sums.contains(key)) order.push_back(key);
      Sum& sum = sums[key];
      const auto histogram = calibration.at("histogram").get<std::vector<std::size_t>>();
      sum.histogram.resize(histogram.size());
      for (std::size_t i = 0; i < histogram.size(); ++i) sum.histogram[i] += histogram[i];
      sum.sigmas = calibration.at("histogram_sigmas");
      sum.numbers += 2 * calibration.at("count").get<std::size_t>();
      sum.nees_ratios.push_back(calibration.at("nees_ratio"));
    });
  }
  Json list = Json::array();
  for (const auto& key : order) {
    const Sum& sum = sums[key];
    list.push_back({{"level", key.first},
                    {"tracker", key.second},
                    {"histogram", sum.histogram},
                    {"sigmas", sum.sigmas},
                    {"numbers", sum.numbers},
                    {"nees_ratio", InterpolatedMedian(sum.nees_ratios)}});
  }
  return list;
}

}  // namespace cohort
