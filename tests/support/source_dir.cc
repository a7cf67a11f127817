#include "tests/support/source_dir.h"

namespace cohort::test {

std::filesystem::path SourceDir() { return COHORT_SOURCE_DIR; }

std::filesystem::path BuildDir() { return COHORT_BUILD_DIR; }

}  // namespace cohort::test
