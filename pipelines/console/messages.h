#pragma once

#include <fmt/format.h>

#include <cstdio>
#include <exception>
#include <string>
#include <string_view>
#include <utility>

#include "frontend/core/error.h"

namespace cohort {

// The stream for this program's own lines: stderr.
std::FILE* OwnStderr();

// Discards all further stderr output of libraries (libpng and libjpeg report every damaged
// picture): our errors report it in one line. Sanitizers and the system still reach stderr.
void SilenceLibraries();

// The message of an exception, reworded if the standard library's names C++ calls.
std::string WhatFailed(const std::exception& exception);

// Prints a line on stdout, without line breaks and terminal control codes that texts from files may
// contain. Throws if stdout fails.
template <typename... Args>
void PrintLine(fmt::format_string<Args...> text, Args&&... args) {
  fmt::print("{}\n", OneLine(fmt::format(text, std::forward<Args>(args)...)));
}

}  // namespace cohort
