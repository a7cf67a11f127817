#include "backend/colmap/program.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <optional>
#include <string_view>

#include "frontend/core/error.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

constexpr const char* kHowToInstall =
    "install it (Debian: apt install colmap) or give --colmap-program PATH";

// Time to print the help, even from a slow disk.
constexpr double kMaxHelpMinutes = 2.0;

std::chrono::duration<double, std::ratio<60>> Minutes(double minutes) {
  return std::chrono::duration<double, std::ratio<60>>(minutes);
}

// The first line of an output that is not COLMAP's help, such as the error of a missing library.
std::string WhatItSays(const std::string& help) {
  constexpr std::size_t kMostBytes = 120;
  const std::size_t begin = help.find_first_not_of("\r\n ");
  if (begin == std::string::npos) return "its -h prints nothing";
  const std::string line = help.substr(begin, help.find_first_of("\r\n", begin) - begin);
  return fmt::format("its -h prints '{}'", OneLine(line.substr(0, kMostBytes)));
}

// The version after "COLMAP": a number and what follows, such as "3.10-dev". Parsed by hand, as
// below, because std::regex overflows the stack on a long word.
std::optional<std::string> VersionIn(const std::string& help) {
  constexpr std::string_view kName = "COLMAP";
  constexpr const char* kBlanks = " \t\r\n\f\v";
  constexpr std::size_t kMostBytes = 40;
  for (std::size_t at = help.find(kName); at != std::string::npos; at = help.find(kName, at + 1)) {
    const std::size_t behind = at + kName.size();
    std::size_t begin = help.find_first_not_of(kBlanks, behind);
    if (begin == std::string::npos || begin == behind) continue;
    if (help[begin] == 'v') ++begin;
    if (begin == help.size() || help[begin] < '0' || help[begin] > '9') continue;
    const std::size_t end = std::min(help.find_first_of(kBlanks, begin), help.size());
    return help.substr(begin, std::min(end - begin, kMostBytes));
  }
  return std::nullopt;
}

// All words that begin with two dashes and a letter, without the dashes.
std::set<std::string> OptionsIn(const std::string& help) {
  constexpr std::string_view kLetters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz";
  const std::string in_names = std::string(kLetters) + "0123456789_.";
  std::set<std::string> options;
  for (std::size_t at = help.find("--"); at != std::string::npos; at = help.find("--", at + 1)) {
    const std::size_t begin = at + 2;
    if (begin == help.size() || kLetters.find(help[begin]) == std::string_view::npos) continue;
    const std::size_t end = std::min(help.find_first_not_of(in_names, begin), help.size());
    options.insert(help.substr(begin, end - begin));
  }
  return options;
}

}  // namespace

ColmapArgument SeedArgument(int seed) {
  return {{"random_seed", "default_random_seed"}, fmt::format("{}", seed), false};
}

ColmapProgram::ColmapProgram(const std::string& program, double max_minutes)
    : max_minutes_(max_minutes) {
  const auto found = FindProgram(program);
  if (!found) {
    ThrowError("colmap is not installed ({} is not a program): {}", program, kHowToInstall);
  }
  path_ = *found;
  const std::string help = HelpText({"-h"});
  const auto version = VersionIn(help);
  if (!version) {
    ThrowError("{} is not COLMAP ({}): {}", path_.string(), WhatItSays(help), kHowToInstall);
  }
  version_ = *version;
}

void RequireColmap(const std::string& program, double max_minutes) {
  const ColmapProgram required(program, max_minutes);
}

std::string ColmapProgram::HelpText(const std::vector<std::string>& arguments) const {
  const double limit =
      max_minutes_ > 0.0 ? std::min(max_minutes_, kMaxHelpMinutes) : kMaxHelpMinutes;
  ProgramOutput output = RunProgramForText(path_, arguments, Minutes(limit));
  if (output.end.out_of_time) {
    ThrowError("{} hangs: its -h had not ended after {:.2g} minutes: {}",
               path_.string(),
               limit,
               kHowToInstall);
  }
  if (output.end.printed_too_much) {
    ThrowError("{} is not COLMAP (the output of {} does not end): {}",
               path_.string(),
               fmt::join(arguments, " "),
               kHowToInstall);
  }
  if (output.end.signal != 0) {
    ThrowError("{} {} was {}: it does not run here: {}",
               path_.string(),
               fmt::join(arguments, " "),
               output.end.Brief(),
               kHowToInstall);
  }
  return std::move(output.text);
}

const std::set<std::string>& ColmapProgram::Options(const std::string& command) {
  const auto [it, added] = options_of_command_.try_emplace(command);
  if (added) {
    it->second = OptionsIn(HelpText({command, "-h"}));
  }
  return it->second;
}

ProgramEnd ColmapProgram::Run(const std::string& command,
                              const std::vector<ColmapArgument>& arguments,
                              const fs::path& log) {
  const std::set<std::string>& known = Options(command);
  std::vector<std::string> line{command};
  std::string unknown;
  for (const ColmapArgument& argument : arguments) {
    const auto name = std::find_if(argument.names.begin(),
                                   argument.names.end(),
                                   [&](const std::string& n) { return known.contains(n); });
    if (name != argument.names.end()) {
      line.push_back("--" + *name);
      line.push_back(argument.value);
    } else if (argument.required) {
      ThrowError("{} {} (COLMAP {}) has no option --{}: this version is not supported",
                 path_.string(),
                 command,
                 version_,
                 fmt::join(argument.names, " or --"));
    } else {
      unknown += " --" + argument.names.front();
    }
  }
  const Descriptor file(
      open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_NOFOLLOW | O_CLOEXEC, 0666));
  if (file.get() < 0) ThrowError("cannot write {}: {}", log.string(), std::strerror(errno));
  std::string header = fmt::format("$ {} {}\n", path_.string(), fmt::join(line, " "));
  if (!unknown.empty()) header += fmt::format("(not known to this COLMAP:{})\n", unknown);
  if (write(file.get(), header.data(), header.size()) != static_cast<ssize_t>(header.size())) {
    ThrowError("cannot write {}: {}", log.string(), std::strerror(errno));
  }
  const ProgramEnd end = RunProgram(path_, line, file.get(), Minutes(max_minutes_));
  if (end.out_of_time) {
    ThrowError(
        "{} {} had not ended after {:.4g} minutes and was killed: raise --colmap.max-minutes (0: "
        "no limit)",
        path_.string(),
        command,
        max_minutes_);
  }
  return end;
}

}  // namespace cohort
