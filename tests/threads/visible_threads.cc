// OpenCV hands work to its threads (TBB) by atomics in libraries that are not compiled for the
// thread sanitizer, which so takes every hand-over for a race. In this program OpenCV's loops run
// on threads of ours, whose hand-overs it sees.
#include <memory>
#include <opencv2/core/parallel/parallel_backend.hpp>
#include <utility>

#include "frontend/core/parallel.h"

// What else is not compiled for it: OpenCV asks GDAL whether a picture is one of its kinds, which
// takes two locks of its own in either order; and libstdc++ counts who holds an exception, so that
// the last one, here a future's thread, deletes it.
extern "C" const char* __tsan_default_suppressions() {
  return "deadlock:libgdal.so\nrace:std::__future_base::_Result\n";
}

namespace cohort::test {
namespace {

class VisibleThreads : public cv::parallel::ParallelForAPI {
 public:
  void parallel_for(int tasks, FN_parallel_for_body_cb_t body, void* data) override {
    ParallelFor(
        static_cast<std::size_t>(tasks), static_cast<unsigned>(threads_), [&](std::size_t i) {
          const int task = static_cast<int>(i);
          body(task, task + 1, data);
        });
  }
  int getThreadNum() const override { return 0; }  // nothing of ours asks
  int getNumThreads() const override { return threads_; }
  int setNumThreads(int threads) override { return std::exchange(threads_, threads); }
  const char* getName() const override { return "visible threads"; }

 private:
  int threads_ = 2;
};

[[maybe_unused]] const bool replaced = [] {
  cv::parallel::setParallelForBackend(std::make_shared<VisibleThreads>());
  return true;
}();

}  // namespace
}  // namespace cohort::test
