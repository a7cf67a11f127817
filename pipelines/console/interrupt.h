#pragma once

namespace cohort {

// While one lives, the first Ctrl-C (SIGINT) or SIGTERM only sets Requested(), so that a loop can
// end cleanly after the frame it is at; the second one ends the program as usual.
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
};

}  // namespace cohort
