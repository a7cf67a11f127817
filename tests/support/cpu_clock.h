#pragma once

#include <ctime>

namespace cohort::test {

// Processor time of this thread [ms]: what else runs on the machine does not count.
inline double CpuMs() {
  std::timespec t{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

}  // namespace cohort::test
