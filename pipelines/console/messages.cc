#include "pipelines/console/messages.h"

namespace cohort {
namespace {

std::FILE* own_stderr = nullptr;  // none: stderr itself

}  // namespace

std::FILE* OwnStderr() { return own_stderr != nullptr ? own_stderr : stderr; }

void SilenceLibraries() {
  if (own_stderr != nullptr) return;
  std::FILE* const nowhere = std::fopen("/dev/null", "we");
  if (nowhere == nullptr) return;
  own_stderr = stderr;
  stderr = nowhere;  // glibc's is a variable
}

}  // namespace cohort
