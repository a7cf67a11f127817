#pragma once

#include <chrono>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "frontend/core/descriptor.h"

namespace cohort {

struct ProgramEnd {
  int exit_code = 0;
  int signal = 0;                 // the one that ended it; 0 if none
  bool out_of_time = false;       // we killed it, by a signal
  bool printed_too_much = false;  // the same

  bool Failed() const { return exit_code != 0 || signal != 0; }
  std::string Brief() const;  // "exit code 1", "killed by signal 9", "killed at its time limit"
};

// A path, or a name that is looked up in PATH. Returns nullopt if there is no such program.
std::optional<std::filesystem::path> FindProgram(const std::string& program);

// Runs a program to its end, without a shell, standard input or a display. The program dies with
// this process, but its own children do not: a script should exec the program that it wraps. All
// its output goes to the descriptor `output`. The program is killed after `time_limit` (zero:
// never), or once it has printed over 1 GiB into a file; the size is checked 20 times a second and
// may exceed the limit. Throws Error if it cannot be started.
ProgramEnd RunProgram(const std::filesystem::path& program,
                      std::vector<std::string> arguments,
                      int output,
                      std::chrono::duration<double> time_limit = {});

// The same with its output as text. A program that prints more than 16 MiB is killed, and only the
// first 16 MiB are kept.
struct ProgramOutput {
  ProgramEnd end;
  std::string text;
};
ProgramOutput RunProgramForText(const std::filesystem::path& program,
                                std::vector<std::string> arguments,
                                std::chrono::duration<double> time_limit = {});

}  // namespace cohort
