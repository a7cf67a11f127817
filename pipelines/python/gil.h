#pragma once

#include <pybind11/pybind11.h>

namespace cohort {

// One of our calls without the GIL, while an instance lives. When the interpreter exits, Python
// ends a thread that requests the GIL back by an unwinding that no C++ destructor survives. The
// exit therefore waits for running calls (AwaitCalls), which end by an Error at their next check
// for signals, and no new ones begin.
class CallWithoutGil {
 public:
  CallWithoutGil();

  // Whether the exit has begun, for threads other than the exiting one.
  static bool MustEnd();
  // For `atexit`: from now on only this thread may begin calls. Waits at most ten seconds. Called
  // with the GIL.
  static void AwaitCalls();

 private:
  struct Counted {
    Counted();
    Counted(const Counted&) = delete;
    Counted& operator=(const Counted&) = delete;
    ~Counted();
  };

  Counted counted_;  // until the GIL is held again
  pybind11::gil_scoped_release no_gil_;
};

}  // namespace cohort
