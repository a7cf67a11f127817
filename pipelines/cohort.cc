#include <malloc.h>

#include "pipelines/commands/all_commands.h"

int main(int argc, char** argv) {
  // Pictures come and go with every frame; memory that the process keeps costs no page faults.
  mallopt(M_MMAP_THRESHOLD, 1 << 28);
  mallopt(M_TRIM_THRESHOLD, 1 << 28);
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  return cohort::RunProgram(cohort::AllCommands(), arguments);
}
