#pragma once

#include <string>

#include "tests/support/shell.h"

namespace cohort::test {

// The program as it was built, with arguments as the shell reads them.
inline ProgramEnd RunCohort(const std::string& arguments) {
  return RunShell(std::string(COHORT_PROGRAM) + " " + arguments);
}

}  // namespace cohort::test
