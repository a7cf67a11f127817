#pragma once

#include <signal.h>

#include <array>

namespace cohort {

// While one lives, the first Ctrl-C (SIGINT) or SIGTERM only sets Requested(), so that a loop can
// end cleanly after the frame it is at; the second one ends the program as usual. A signal that is
// ignored stays so.
//
//   const InterruptGuard interrupt;
//   while (work && !interrupt.Requested()) ...
class InterruptGuard {
 public:
  InterruptGuard();
  InterruptGuard(const InterruptGuard&) = delete;
  InterruptGuard& operator=(const InterruptGuard&) = delete;
  ~InterruptGuard();

  bool Requested() const;

 private:
  static constexpr std::array kSignals{SIGINT, SIGTERM};
  std::array<struct sigaction, kSignals.size()> before_{};
};

}  // namespace cohort
