#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace cohort {

// A piece of an experiment that runs in its own process, so that a crash costs one task. Its result
// file, written at the end, holds
//   {"program": its fingerprint, "options": ..., "figures": what `run` returned | null,
//    "error": one line | null, "seconds": s}
// and its output goes to the same name with .log appended.
struct Task {
  std::string label;  // for the log: "track room medium 1 klt"
  std::filesystem::path result;
  std::string options;  // JSON of all it depends on; a result with others is not reused
  std::function<nlohmann::ordered_json()> run;
  // Other processes may have the same task: one of them runs it, the others wait for it.
  bool shared = false;
  // The file or folder that it creates besides its result; empty if no other task needs one.
  std::filesystem::path makes = {};
};

// Whether its result exists, good or bad, from this program and with these options.
bool HasResult(const Task& task);
// Whether its result exists without an error, and the file that it makes.
bool IsDone(const Task& task);

// Runs the tasks, `jobs` at a time; with `resume` only those not done yet. On Ctrl-C it ends the
// running ones and throws Error. The calling process must not have used OpenCV's threads, because
// it forks.
void RunTasks(const std::string& stage, const std::vector<Task>& tasks, int jobs, bool resume);

}  // namespace cohort
