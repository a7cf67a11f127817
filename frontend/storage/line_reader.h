#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <utility>

#include "frontend/core/error.h"

namespace cohort {

// Reads the lines of a text file one at a time. The limit of 65,535 characters per line bounds the
// memory. Throws Error naming path and line.
class LineReader {
 public:
  explicit LineReader(const std::filesystem::path& path);

  bool Next();
  std::string_view line() const { return line_; }  // without its line ending, also of Windows

  template <typename... Args>
  [[noreturn]] void Throw(fmt::format_string<Args...> text, Args&&... args) const {
    ThrowAt(number_, fmt::format(text, std::forward<Args>(args)...));
  }
  [[noreturn]] void ThrowAt(std::size_t number, const std::string& what) const;
  const std::filesystem::path& path() const { return path_; }
  std::size_t number() const { return number_; }  // of the line, from 1

 private:
  std::filesystem::path path_;
  std::ifstream stream_;
  std::array<char, 1 << 16> buffer_;
  std::string_view line_;
  std::size_t number_ = 0;
};

}  // namespace cohort
