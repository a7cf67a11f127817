#include "pipelines/console/messages.h"

#include <filesystem>
#include <system_error>

namespace cohort {
namespace {

std::FILE* own_stderr = nullptr;  // null: stderr itself

}  // namespace

std::FILE* OwnStderr() { return own_stderr != nullptr ? own_stderr : stderr; }

void SilenceLibraries() {
  if (own_stderr != nullptr) return;
  std::FILE* const nowhere = std::fopen("/dev/null", "we");
  if (nowhere == nullptr) return;
  own_stderr = stderr;
  stderr = nowhere;  // assignable in glibc
}

std::string WhatFailed(const std::exception& exception) {
  const auto* refused = dynamic_cast<const std::filesystem::filesystem_error*>(&exception);
  if (refused == nullptr) return exception.what();
  std::string reason = refused->code().message();
  std::error_code error;
  const bool is_gone =
      std::filesystem::current_path(error).empty() && error == std::errc::no_such_file_or_directory;
  if (is_gone && refused->path1().is_relative()) {
    return "the current folder is gone: change to another, or give absolute paths";
  }
  if (refused->path1().empty()) return reason;
  if (refused->path2().empty()) {
    return fmt::format("cannot use {}: {}", refused->path1().string(), reason);
  }
  return fmt::format(
      "cannot use {} and {}: {}", refused->path1().string(), refused->path2().string(), reason);
}

}  // namespace cohort
