#pragma once

#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "frontend/storage/output.h"
#include "tests/support/shell.h"

namespace cohort::test {

// Runs Python with Debian's NumPy as np in a folder; what it prints.
inline std::string RunNumpy(const std::filesystem::path& folder, const std::string& script) {
  const TempDir dir;
  WriteBytes(dir / "script.py", "import numpy as np\n" + script + "\n");
  const ProgramEnd end = RunShell("cd '" + folder.string() + "' && /usr/bin/python3 -B '" +
                                  (dir / "script.py").string() + "'");
  EXPECT_EQ(end.exit_code, 0) << end.err;
  return end.out;
}

}  // namespace cohort::test
