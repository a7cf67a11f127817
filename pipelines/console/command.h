#pragma once

#include <functional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "pipelines/console/command_line.h"

namespace cohort {

// A command of the program; run() parses its arguments, executes it and returns the exit code.
struct Command {
  std::string name;
  std::string usage;
  std::string summary;
  std::vector<OptionHelp> options;
  std::function<int(std::span<const std::string> arguments)> run;
};

// `run` is a function of the options alone, so that tests can call it too.
template <typename Options>
Command MakeCommand(CommandLine line, void (*run)(const Options&)) {
  Options defaults;
  std::vector<OptionHelp> help = HelpOfOptions(line, ListOptions(defaults));
  return {line.name,
          line.usage,
          line.summary,
          std::move(help),
          [line, run](std::span<const std::string> arguments) {
            Options options;
            if (ParseCommandLine(line, ListOptions(options), arguments) == ParseOutcome::kRun) {
              run(options);
            }
            return 0;
          }};
}

// The whole program: finds the command, and turns every exception into one line `cohort: error:
// ...` on stderr and an exit code: 0 success, 1 failure, 2 usage.
int RunProgram(const std::vector<Command>& commands, std::span<const std::string> arguments);

}  // namespace cohort
