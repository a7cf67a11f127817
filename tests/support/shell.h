#pragma once

#include <sys/wait.h>
#include <cstdlib>
#include <string>

#include "frontend/storage/output.h"
#include "tests/support/temp_dir.h"

namespace cohort::test {

struct ProgramEnd {
  int exit_code = 0;  // -1: ended by a signal
  std::string out;
  std::string err;
};

// Runs a line of shell and waits for its end.
inline ProgramEnd RunShell(const std::string& line) {
  const TempDir dir;
  const std::string out = dir / "out";
  const std::string err = dir / "err";
  const int status = std::system(("{ " + line + "\n} >" + out + " 2>" + err).c_str());
  return {WIFEXITED(status) ? WEXITSTATUS(status) : -1, ReadBytes(out), ReadBytes(err)};
}

}  // namespace cohort::test
