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
  int signal = 0;                 // that ended it; 0: none
  bool out_of_time = false;       // we killed it, by a signal
  bool printed_too_much = false;  // the same

  bool Failed() const { return exit_code != 0 || signal != 0; }
  std::string Brief() const;  // "exit code 1", "killed by signal 9", "killed at its time limit"
};

// A path, or a name that is looked up in PATH; none if there is no such program.
std::optional<std::filesystem::path> FindProgram(const std::string& program);

// Runs a program to its end: without a shell, without standard input, without a display; it dies
// with us (what it started itself does not: a script should exec the program that it wraps). All
// that it prints goes to the descriptor `output`. After `time_limit` it is killed (zero: never), and
// where it has printed over 1 GiB into a file; looked at 20 times a second, so that it may be more.
// Throws Error if it cannot be started.
ProgramEnd RunProgram(const std::filesystem::path& program,
                      std::vector<std::string> arguments,
                      int output,
                      std::chrono::duration<double> time_limit = {});

// The same with what it printed as text, of which no more than the first 16 MiB: it is killed where
// it has printed more.
struct ProgramOutput {
  ProgramEnd end;
  std::string text;
};
ProgramOutput RunProgramForText(const std::filesystem::path& program,
                                std::vector<std::string> arguments,
                                std::chrono::duration<double> time_limit = {});

}  // namespace cohort
