#pragma once

#include <pybind11/pybind11.h>

namespace cohort {

// A call of ours without the GIL, while one lives. When the interpreter exits, Python ends a thread
// that asks for the GIL back, by an unwinding that no destructor of C++ survives: so the exit waits
// for the calls that run (AwaitCalls), which end by an Error at their next look for signals, and others
// begin no more.
class CallWithoutGil {
 public:
  CallWithoutGil();

  // Has the exit begun, for others than the thread that exits?
  static bool MustEnd();
  // For `atexit`: from now on no call begins but this thread's. Waits ten seconds at most. Called with
  // the GIL.
  static void AwaitCalls();

 private:
  struct Counted {
    Counted();
    Counted(const Counted&) = delete;
    Counted& operator=(const Counted&) = delete;
    ~Counted();
  };

  Counted counted_;  // until the GIL is there again
  pybind11::gil_scoped_release no_gil_;
};

}  // namespace cohort
