#include <malloc.h>

#include "pipelines/commands/all_commands.h"

int main(int argc, char** argv) {
  // Pictures come and go with every frame. Memory that the process keeps costs no page faults, which
  // took a tenth of the time of tracking.
  mallopt(M_MMAP_THRESHOLD, 1 << 28);
  mallopt(M_TRIM_THRESHOLD, 1 << 28);
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  return cohort::RunProgram(cohort::AllCommands(), arguments);
}
