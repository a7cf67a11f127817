#include "pipelines/commands/all_commands.h"

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);
  return cohort::RunProgram(cohort::AllCommands(), arguments);
}
