#pragma once

#include <condition_variable>
#include <deque>
#include <future>
#include <mutex>
#include <thread>
#include <type_traits>
#include <utility>

namespace cohort {

// One thread beside the caller's that runs all its tasks in order. It is not a thread per task, as
// with std::async, because OpenCV keeps memory for every thread that ever called it.
class Worker {
 public:
  Worker() = default;
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;
  // Waits for the running task; drops those not begun.
  ~Worker();

  // Gives the result, or the exception, of `work()`.
  template <typename Work>
  std::future<std::invoke_result_t<Work>> Begin(Work work) {
    std::packaged_task<std::invoke_result_t<Work>()> task(std::move(work));
    auto result = task.get_future();
    Add(std::packaged_task<void()>([task = std::move(task)]() mutable { task(); }));
    return result;
  }

 private:
  void Add(std::packaged_task<void()> task);
  void Run();

  std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<std::packaged_task<void()>> waiting_;
  bool ending_ = false;
  std::thread thread_;  // runs from the first task on
};

}  // namespace cohort
