#pragma once

#include <map>
#include <string_view>

namespace cohort {

// Processor time of this thread [ms]; other load on the machine does not count.
double ThreadCpuMs();

// Profiles parts of the program for benchmarks: while an instance lives, scopes of its thread that
// hold a TimedPart add their processor time to it. The time of a nested scope is subtracted from
// the outer one's.
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

// Costs only the test of a pointer if no PartTimes lives.
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
