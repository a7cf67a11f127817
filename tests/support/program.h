#pragma once

#include <string>

#include "tests/support/shell.h"
#include "tests/support/source_dir.h"

namespace cohort::test {

// The program as it was built.
inline std::string ProgramPath() { return BuildDir() / "cohort"; }

// Run with arguments as the shell reads them.
inline ProgramEnd RunCohort(const std::string& arguments) {
  return RunShell(ProgramPath() + " " + arguments);
}

}  // namespace cohort::test
