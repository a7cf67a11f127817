#pragma once

#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "pipelines/console/command_line.h"

namespace cohort {

// One of the program's commands; run() parses its arguments, does it and returns the exit code.
struct Command {
  std::string name;
  std::string summary;
  std::function<int(std::span<const std::string> arguments)> run;
};

// `run` is a function of the options alone, so that tests can call it too.
template <typename Options>
Command MakeCommand(CommandLine line, void (*run)(const Options&)) {
  std::string name = line.name;
  std::string summary = line.summary;
  return {std::move(name),
          std::move(summary),
          [line = std::move(line), run](std::span<const std::string> arguments) {
            Options options;
            if (ParseCommandLine(line, ListOptions(options), arguments) == ParseOutcome::kRun) {
              run(options);
            }
            return 0;
          }};
}

// The whole program: finds the command, turns every exception into one line `cohort: error: ...` on
// stderr and an exit code: 0 done, 1 failed, 2 usage.
int RunProgram(const std::vector<Command>& commands, std::span<const std::string> arguments);

}  // namespace cohort
