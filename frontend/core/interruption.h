#pragma once

#include <functional>
#include <utility>

namespace cohort {

// Lets whoever runs a long job end it. While one lives, CheckInterruption() in its thread calls
// `check`, which ends the job by throwing: Python's Ctrl-C. The latest one counts.
class InterruptionCheck {
 public:
  explicit InterruptionCheck(std::function<void()> check)
      : check_(std::move(check)), outer_(std::exchange(innermost, this)) {}
  InterruptionCheck(const InterruptionCheck&) = delete;
  InterruptionCheck& operator=(const InterruptionCheck&) = delete;
  ~InterruptionCheck() { innermost = outer_; }

 private:
  friend void CheckInterruption();
  inline static thread_local InterruptionCheck* innermost = nullptr;

  std::function<void()> check_;
  InterruptionCheck* outer_;
};

// Called often, at least once in the time of a frame where that can be, by work that has no
// StageProgress. Nothing where nobody asked for it.
inline void CheckInterruption() {
  if (InterruptionCheck::innermost != nullptr) InterruptionCheck::innermost->check_();
}

}  // namespace cohort
