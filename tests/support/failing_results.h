#pragma once

#include "pipelines/experiment/results.h"

namespace cohort::test {

// klt fails with one of two seeds, subspace with none, descent with both.
inline ExperimentResults FailingResults() {
  ExperimentResults results;
  const auto add = [&](const char* tracker, unsigned seed, double registered, double ate_m) {
    const bool failed = registered < 80;
    const auto row = [&](const char* backend, const char* metric, double value, const char* unit) {
      results.rows.push_back({"room", "hard", tracker, backend, seed, metric, value, unit});
    };
    row("", "mean_track_length", 10.0 * seed, "frames");
    row("ceres", "failed", failed, "");
    row("ceres", "registered", registered, "frames");
    row("ceres", "frames", 100, "frames");
    if (failed) {
      results.failures.push_back({"room", "hard", tracker, "ceres", seed, "no start"});
    } else {
      row("ceres", "ate", ate_m, "m");
    }
  };
  add("klt", 1, 100, 0.010);
  add("klt", 2, 15, 0.0001);
  add("descent", 1, 2, 0.0001);
  add("descent", 2, 4, 0.0001);
  add("subspace", 1, 100, 0.002);
  add("subspace", 2, 98, 0.003);
  return results;
}

}  // namespace cohort::test
