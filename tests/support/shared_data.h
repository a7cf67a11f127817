#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

#include "tests/support/source_dir.h"

namespace cohort::test {

// A real sequence that may not be published: $COHORT_DATA/NAME, by default ../shared/data/NAME
// beside the source folder. Tests skip where it is missing.
inline std::filesystem::path SharedData(const std::string& name) {
  const char* const folder = std::getenv("COHORT_DATA");
  const std::filesystem::path data =
      folder != nullptr ? std::filesystem::path(folder) : SourceDir() / "../shared/data";
  return data / name;
}

// Skips the test, saying what is missing.
#define COHORT_SKIP_WITHOUT(path)                                                       \
  if (!std::filesystem::exists(path)) {                                                 \
    GTEST_SKIP() << "no " << (path).string() << ": set COHORT_DATA to the data folder"; \
  }

}  // namespace cohort::test
