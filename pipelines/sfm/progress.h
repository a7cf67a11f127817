#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <string_view>

namespace cohort {

// Called after every frame with the progress of a job. `stage`: "look", "track", "learn", "measure"
// or "write frames"; `total` is unset if unknown. An exception from it ends the job.
using StageProgress =
    std::function<void(std::string_view stage, std::size_t done, std::optional<std::size_t> total)>;

// What a job tells its user while it runs: progress and lines. Any of them may be empty.
struct JobReport {
  StageProgress progress = {};
  std::function<void(const std::string& line)> info = {};
  std::function<void(const std::string& line)> warning = {};

  // These do nothing with an empty line.
  void Tell(const std::string& line) const {
    if (info && !line.empty()) info(line);
  }
  void Warn(const std::string& line) const {
    if (warning && !line.empty()) warning(line);
  }
};

}  // namespace cohort
