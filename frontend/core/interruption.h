#pragma once

#include <functional>
#include <utility>

namespace cohort {

// Lets a caller interrupt a long job. While an instance lives, CheckInterruption() in its thread
// calls `check`, which ends the job by throwing, as Python's Ctrl-C does. The latest instance
// counts.
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

// Work without a StageProgress calls this often, at least once per frame if possible. Does nothing
// without an InterruptionCheck.
inline void CheckInterruption() {
  if (InterruptionCheck::innermost != nullptr) InterruptionCheck::innermost->check_();
}

}  // namespace cohort
