#pragma once

#include <signal.h>

#include <array>

namespace cohort {

// While an instance lives, the first Ctrl-C (SIGINT) or SIGTERM only sets Requested(), so that a
// loop can end cleanly after the current frame; the second one ends the program as usual. An
// ignored signal stays ignored.
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
