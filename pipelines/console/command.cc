#include "pipelines/console/command.h"

#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <opencv2/core/utils/logger.hpp>

#include "frontend/core/error.h"
#include "pipelines/console/version.h"

namespace cohort {
namespace {

// The log goes to stderr. What OpenCV and its video decoder print beside their exceptions and
// return values would only repeat, less clearly, what our own errors say.
void SetUpLogging() {
  auto logger = std::make_shared<spdlog::logger>(
      "cohort", std::make_shared<spdlog::sinks::stderr_color_sink_mt>());
  logger->set_pattern("cohort: %l: %v");
  spdlog::set_default_logger(std::move(logger));
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", /*overwrite=*/0);
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
  ThrowUsageError("unknown command '{}': 'cohort --help' lists the commands", name);
}

int Fail(int exit_code, std::string_view prefix, std::string what) {
  std::replace(what.begin(), what.end(), '\n', ' ');
  fmt::print(stderr, "cohort: error: {}{}\n", prefix, what);
  return exit_code;
}

}  // namespace

int RunProgram(const std::vector<Command>& commands, std::span<const std::string> arguments) {
  try {
    SetUpLogging();
    const int exit_code = Dispatch(commands, arguments);
    if (std::fflush(stdout) != 0) ThrowError("cannot write to standard output");
    return exit_code;
  } catch (const UsageError& e) {
    return Fail(2, "", e.what());
  } catch (const Error& e) {
    return Fail(1, "", e.what());
  } catch (const std::bad_alloc&) {
    return Fail(1, "", "out of memory: give fewer features, a smaller picture or fewer frames");
  } catch (const std::exception& e) {
    return Fail(1, "internal: ", e.what());
  }
}

}  // namespace cohort
