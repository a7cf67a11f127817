#pragma once

#include <chrono>
#include <cstddef>
#include <optional>
#include <string>

#include "pipelines/sfm/progress.h"

namespace cohort {

// One line on stderr, `track [===== ] 120/300 87.0 fps ETA 0:02`, redrawn at most ten times a
// second, cut to the terminal's width and wiped at the end. Draws nothing if stderr is not a
// terminal or a dumb one, or the log is quiet. An empty `rate_unit` hides the speed.
class ProgressBar {
 public:
  explicit ProgressBar(std::string label,
                       std::optional<std::size_t> total,
                       std::string rate_unit = "fps");
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;
  ~ProgressBar();

  void Advance(std::size_t steps = 1);  // 0: only updates the time
  void Wipe();                          // before something else is written to the terminal

 private:
  using Clock = std::chrono::steady_clock;

  bool shown_;
  std::string label_;
  std::optional<std::size_t> total_;
  std::string rate_unit_;
  std::size_t done_ = 0;
  Clock::time_point start_ = Clock::now();
  Clock::time_point next_draw_ = start_;
};

// A job's progress as a bar for each stage, one after the other, and its lines in the log. The last
// bar is wiped when the report and all copies are gone.
JobReport ConsoleReport();
// The progress alone.
StageProgress ProgressBars();

// The line itself, as drawn after `seconds`.
std::string ProgressLine(const std::string& label,
                         std::size_t done,
                         std::optional<std::size_t> total,
                         double seconds,
                         const std::string& rate_unit);

}  // namespace cohort
