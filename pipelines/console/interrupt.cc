#include "pipelines/console/interrupt.h"

#include <csignal>

namespace cohort {
namespace {

volatile std::sig_atomic_t requested = 0;

void Request(int) { requested = 1; }

void SetHandler(void (*handler)(int)) {
  struct sigaction action {};
  action.sa_handler = handler;
  action.sa_flags = SA_RESTART | static_cast<int>(SA_RESETHAND);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
}

}  // namespace

InterruptGuard::InterruptGuard() {
  requested = 0;
  SetHandler(Request);
}

InterruptGuard::~InterruptGuard() { SetHandler(SIG_DFL); }

bool InterruptGuard::Requested() const { return requested != 0; }

}  // namespace cohort
