#pragma once

#include <filesystem>

namespace cohort::test {

// The root of the checkout that the tests were built from. One source file knows it, so that a
// compiler cache serves every checkout.
std::filesystem::path SourceDir();
// Where it was built.
std::filesystem::path BuildDir();

}  // namespace cohort::test
