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
    if (!fs::exists(file)) continue;
    const Json errors = ReadJsonFile(file);
    if (!errors.contains("calibration") || errors["calibration"].is_null()) continue;
    const Json& calibration = errors["calibration"];
    const std::pair key(cell.condition.level, cell.tracker.name);
    if (!sums.contains(key)) order.push_back(key);
    Sum& sum = sums[key];
    const auto histogram = calibration["histogram"].get<std::vector<std::size_t>>();
    sum.histogram.resize(histogram.size());
    for (std::size_t i = 0; i < histogram.size(); ++i) sum.histogram[i] += histogram[i];
    sum.sigmas = calibration["histogram_sigmas"];
    sum.numbers += 2 * calibration["count"].get<std::size_t>();
    sum.nees_ratios.push_back(calibration["nees_ratio"]);
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
