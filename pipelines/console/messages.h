#pragma once

#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <string>
#include <string_view>
#include <utility>

#include "frontend/core/error.h"

namespace cohort {

// Where this program's own lines go: stderr.
std::FILE* OwnStderr();

// From here on, what libraries print to stderr by themselves (libpng and libjpeg tell of every damaged
// picture) goes nowhere: our errors say it in one line. Sanitizers and the system still reach it.
void SilenceLibraries();

// What an exception says, in our words where those of the standard library would name calls of C++.
std::string WhatFailed(const std::exception& exception);

// A line on stdout, without the line breaks and codes for terminals that texts of files may hold.
// Throws where stdout cannot take it.
template <typename... Args>
void PrintLine(fmt::format_string<Args...> text, Args&&... args) {
  fmt::print("{}\n", OneLine(fmt::format(text, std::forward<Args>(args)...)));
}

}  // namespace cohort
