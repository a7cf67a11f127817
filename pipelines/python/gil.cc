#include "pipelines/python/gil.h"

#include <atomic>
#include <chrono>
#include <thread>

#include "frontend/core/error.h"

namespace cohort {
namespace {

std::atomic<int> calls = 0;
std::atomic<bool> exiting = false;
std::thread::id exits;  // before `exiting`

}  // namespace

CallWithoutGil::Counted::Counted() {
  if (MustEnd()) ThrowError("the interpreter is exiting: no new work is started");
  ++calls;
}

CallWithoutGil::Counted::~Counted() { --calls; }

CallWithoutGil::CallWithoutGil() = default;

bool CallWithoutGil::MustEnd() { return exiting && std::this_thread::get_id() != exits; }

void CallWithoutGil::AwaitCalls() {
  exits = std::this_thread::get_id();
  exiting = true;
  const pybind11::gil_scoped_release no_gil;
  // Bounded, because frames may come from a generator that waits for something that never comes.
  const auto latest = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (calls > 0 && std::chrono::steady_clock::now() < latest) {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

}  // namespace cohort
