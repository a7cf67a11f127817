#pragma once

#include <map>
#include <string_view>

namespace cohort {

// Processor time of this thread [ms]: what else runs on the machine does not count.
double ThreadCpuMs();

// Where the time goes, for benchmarks: while one is alive, scopes of its thread that hold a TimedPart
// add their processor time to it. A scope within another's takes its time from the outer one.
//
//   PartTimes times;   { const TimedPart part("guide"); ... }   times.ms()["guide"]
class PartTimes {
 public:
  PartTimes();
  ~PartTimes();
  PartTimes(const PartTimes&) = delete;
  PartTimes& operator=(const PartTimes&) = delete;

  const std::map<std::string_view, double>& ms() const { return ms_; }

 private:
  friend class TimedPart;
  std::map<std::string_view, double> ms_;
  PartTimes* outer_;
};

// Nothing but the test of a pointer where no PartTimes is alive.
class TimedPart {
 public:
  explicit TimedPart(std::string_view name);  // a literal: it is not copied
  ~TimedPart();
  TimedPart(const TimedPart&) = delete;
  TimedPart& operator=(const TimedPart&) = delete;

 private:
  PartTimes* times_;
  std::string_view name_;
  TimedPart* outer_ = nullptr;
  double start_ms_ = 0.0;
};

}  // namespace cohort
