#pragma once

#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace cohort {

// A piece of an experiment that a process of its own does, so that a crash costs one task. Its
// result file, written at the end, holds
//   {"program": its fingerprint, "options": ..., "figures": what `run` returned | null,
//    "error": one line | null, "seconds": s}
// and what it prints goes to the same name with .log behind.
struct Task {
  std::string label;  // for the log: "track room medium 1 klt"
  std::filesystem::path result;
  std::string options;  // JSON of all it depends on; a result with others is not reused
  std::function<nlohmann::ordered_json()> run;
  // Other processes may have the same task: one of them does it, the others wait for it.
  bool shared = false;
  // The file or folder that it makes beside its result; empty: none, or none that others need.
  std::filesystem::path makes = {};
};

// Is its result there, good or bad: of this program, with these options?
bool HasResult(const Task& task);
// Has it its result, without an error, and what it makes?
bool IsDone(const Task& task);

// Does the tasks, `jobs` at a time, with `resume` those that are not done yet. Interrupted by Ctrl-C,
// ends the running ones and throws Error. The calling process must not have used OpenCV's threads: it
// forks.
void RunTasks(const std::string& stage, const std::vector<Task>& tasks, int jobs, bool resume);

}  // namespace cohort
