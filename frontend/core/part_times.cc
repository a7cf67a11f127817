#include "frontend/core/part_times.h"

#include <ctime>

namespace cohort {
namespace {

thread_local PartTimes* alive = nullptr;
thread_local TimedPart* innermost = nullptr;

}  // namespace

double ThreadCpuMs() {
  std::timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

PartTimes::PartTimes() : outer_(alive) { alive = this; }
PartTimes::~PartTimes() { alive = outer_; }

TimedPart::TimedPart(std::string_view name) : times_(alive), name_(name) {
  if (times_ == nullptr) return;
  outer_ = innermost;
  innermost = this;
  start_ms_ = ThreadCpuMs();
  if (outer_ != nullptr) times_->ms_[outer_->name_] += start_ms_ - outer_->start_ms_;
}

TimedPart::~TimedPart() {
  if (times_ == nullptr) return;
  const double now_ms = ThreadCpuMs();
  times_->ms_[name_] += now_ms - start_ms_;
  innermost = outer_;
  if (outer_ != nullptr) outer_->start_ms_ = now_ms;
}

}  // namespace cohort
