#include "pipelines/console/command.h"

#include <fcntl.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <iostream>
#include <new>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <stdexcept>
#include <string_view>

#include "frontend/core/error.h"
#include "frontend/storage/input_record.h"
#include "pipelines/console/messages.h"
#include "pipelines/sfm/version.h"

namespace cohort {
namespace {

constexpr const char* kOutOfMemory =
    "out of memory: use fewer frames, smaller pictures, fewer features or a smaller file";

// A message of the log without line breaks.
class OneLineOfLog : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message,
              const std::tm&,
              spdlog::memory_buf_t& out) override {
    const std::string line = OneLine({message.payload.data(), message.payload.size()});
    out.append(line.data(), line.data() + line.size());
  }
  std::unique_ptr<custom_flag_formatter> clone() const override {
    return std::make_unique<OneLineOfLog>();
  }
};

// The log goes to stderr. What OpenCV and its video decoder print besides their exceptions and
// return values would only repeat our own errors less clearly.
void SetUpLogging() {
  auto logger = std::make_shared<spdlog::logger>(
      "cohort", std::make_shared<spdlog::sinks::stderr_color_sink_mt>());
  auto formatter = std::make_unique<spdlog::pattern_formatter>();
  formatter->add_flag<OneLineOfLog>('*').set_pattern("cohort: %l: %*");
  logger->set_formatter(std::move(formatter));
  spdlog::set_default_logger(std::move(logger));
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", /*overwrite=*/0);
  std::cerr.setstate(std::ios::failbit);  // silences OpenCV's picture decoders; we print by stdio
  SilenceLibraries();                     // silences the libraries behind them
}

std::string Help(const std::vector<Command>& commands) {
  std::string text =
      "cohort: joint feature tracking for structure from motion in dark, noisy video\n\n"
      "Usage: cohort COMMAND ... | cohort COMMAND --help or --help-all | cohort --version\n\n";
  for (const Command& command : commands) {
    text += fmt::format("  {:<12}{}\n", command.name, command.summary);
  }
  return text;
}

int Dispatch(const std::vector<Command>& commands, std::span<const std::string> arguments) {
  if (arguments.empty()) ThrowUsageError("no command: 'cohort --help' lists the commands");
  const std::string& name = arguments.front();
  if (name == "--help" || name == "-h" || name == "help") {
    fmt::print("{}", Help(commands));
    return 0;
  }
  if (name == "--version") {
    fmt::print("cohort {}\n", kVersion);
    return 0;
  }
  for (const Command& command : commands) {
    if (command.name == name) return command.run(arguments.subspan(1));
  }
  std::error_code ignored;
  if (std::filesystem::exists(name, ignored)) {
    ThrowUsageError(
        "{} is not a command: 'cohort sfm {} --out scene' makes a scene from it", name, name);
  }
  ThrowUsageError("unknown command '{}': 'cohort --help' lists the commands", name);
}

// Does not throw if stderr is full or closed, because the exit code must report the failure anyway.
int Fail(int exit_code, std::string_view prefix, std::string_view what) {
  std::fputs(fmt::format("cohort: error: {}{}\n", prefix, OneLine(what)).c_str(), OwnStderr());
  return exit_code;
}

// A file that is opened while a standard stream is closed would get the stream's number, and the
// log or the table would be written into it. Closed streams are therefore opened such that writing
// fails.
void OpenStandardStreams() {
  while (true) {
    const int fd = open("/dev/null", O_RDONLY);
    if (fd < 0) return;
    if (fd > STDERR_FILENO) {
      close(fd);
      return;
    }
  }
}

}  // namespace

int RunProgram(const std::vector<Command>& commands, std::span<const std::string> arguments) {
  try {
    OpenStandardStreams();
    signal(SIGPIPE, SIG_IGN);  // a reader that exits does not end the work
    // We would inherit an ignored SIGCHLD, and the exit statuses of children would not be
    // available.
    signal(SIGCHLD, SIG_DFL);
    signal(SIGXFSZ, SIG_IGN);  // a file at its size limit is a failed write
    const InputRecord record;
    SetUpLogging();
    const int exit_code = Dispatch(commands, arguments);
    if (std::fflush(stdout) != 0)
      ThrowError("cannot write to standard output: {}", std::strerror(errno));
    return exit_code;
  } catch (const UsageError& e) {
    return Fail(2, "", e.what());
  } catch (const Error& e) {
    return Fail(1, "", e.what());
  } catch (const std::bad_alloc&) {
    return Fail(1, "", kOutOfMemory);
  } catch (const std::length_error&) {  // a size beyond the possible
    return Fail(1, "", kOutOfMemory);
  } catch (const cv::Exception& e) {
    if (e.code == cv::Error::StsNoMem) return Fail(1, "", kOutOfMemory);
    return Fail(1, "internal: ", e.what());
  } catch (const std::filesystem::filesystem_error& e) {
    return Fail(1, "", WhatFailed(e));
  } catch (const std::exception& e) {
    // fmt::print throws if the disk is full.
    if (std::ferror(stdout) != 0) return Fail(1, "", "cannot write to standard output");
    // The message of libraries that cannot start a thread.
    if (std::string_view(e.what()).find(std::strerror(EAGAIN)) != std::string_view::npos) {
      return Fail(1,
                  "",
                  "the system cannot start more threads: there are too many processes (ulimit -u) "
                  "or too little memory (ulimit -v); use --threads 1 where that option exists");
    }
    return Fail(1, "internal: ", e.what());
  }
}

}  // namespace cohort
