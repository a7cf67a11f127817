#include "pipelines/experiment/tasks.h"

#include <fcntl.h>
#include <signal.h>
#include <spdlog/spdlog.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>

#include "frontend/core/error.h"
#include "frontend/core/stopwatch.h"
#include "frontend/storage/write_lock.h"
#include "pipelines/console/interrupt.h"
#include "pipelines/console/messages.h"
#include "pipelines/console/progress_bar.h"
#include "pipelines/json/json_file.h"
#include "pipelines/sfm/fingerprint.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

void WriteResult(const Task& task, const Json& figures, const Json& error, double seconds) {
  WriteJsonFile(task.result,
                {{"program", FingerprintOfProgram()},
                 {"options", Json::parse(task.options)},
                 {"figures", figures},
                 {"error", error},
                 {"seconds", seconds}});
}

bool IsOf(const Json& result, const Task& task) {
  return result.value("program", "") == FingerprintOfProgram() &&
         result.at("options") == Json::parse(task.options);
}

// Whether its output exists or is not needed.
bool HasMade(const Json& result, const Task& task) {
  return task.makes.empty() || result.at("figures").contains("not_available") ||
         fs::exists(task.makes);
}

[[noreturn]] void RunInChild(const Task& task, pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(EXIT_FAILURE);  // the parent died before the prctl above
  const std::string log = task.result.string() + ".log";
  int descriptor = open(log.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, 0644);
  // The parent reports why it could not be opened.
  if (descriptor < 0) descriptor = open("/dev/null", O_WRONLY | O_CLOEXEC);
  if (descriptor >= 0) {
    dup2(descriptor, STDOUT_FILENO);
    dup2(descriptor, STDERR_FILENO);
  }
  const Stopwatch stopwatch;
  int exit_code = 0;
  try {
    std::optional<WriteLock> lock;
    if (task.shared) lock = WriteLock::Await(task.result.string() + ".lock");
    if (!task.shared || !IsDone(task)) {
      Json figures;
      Json error;
      try {
        figures = task.run();
      } catch (const std::exception& e) {
        error = OneLine(WhatFailed(e));
      }
      WriteResult(task, figures, error, stopwatch.Seconds());
    }
  } catch (const std::exception& e) {
    std::fputs(fmt::format("cohort: error: {}\n", OneLine(WhatFailed(e))).c_str(), OwnStderr());
    exit_code = 1;
  }
  std::fflush(stdout);
  _exit(exit_code);
}

pid_t Start(const Task& task) {
  fs::create_directories(task.result.parent_path());
  std::error_code ignored;
  if (!task.shared) fs::remove(task.result, ignored);
  std::fflush(stdout);
  std::fflush(OwnStderr());
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child < 0) ThrowError("cannot start a process: {}", std::strerror(errno));
  if (child == 0) RunInChild(task, parent);
  return child;
}

// Writes the result of a process that died without writing one.
void RecordEnd(const Task& task, int status) {
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return;
  const std::string how =
      WIFSIGNALED(status)
          ? fmt::format("killed by signal {}", WTERMSIG(status))
          : fmt::format("could not write its result, see {}.log", task.result.string());
  WriteResult(task, nullptr, how, 0.0);
}

}  // namespace

bool IsDone(const Task& task) {
  if (!fs::exists(task.result)) return false;
  bool done = false;
  try {
    UseJsonFile(task.result, [&](const Json& result) {
      done = result.at("error").is_null() && IsOf(result, task) && HasMade(result, task);
    });
  } catch (const Error& error) {
    spdlog::warn("{}; it is run again", error.what());
  }
  return done;
}

bool HasResult(const Task& task) {
  if (!fs::exists(task.result)) return false;
  bool is_of_task = false;
  UseJsonFile(task.result, [&](const Json& result) { is_of_task = IsOf(result, task); });
  return is_of_task;
}

void RunTasks(const std::string& stage, const std::vector<Task>& tasks, int jobs, bool resume) {
  std::vector<const Task*> open;
  for (const Task& task : tasks) {
    if (!(resume || task.shared) || !IsDone(task)) open.push_back(&task);
  }
  if (open.size() < tasks.size()) {
    spdlog::info("{}: {} of {} are done already", stage, tasks.size() - open.size(), tasks.size());
  }

  const InterruptGuard interrupt;
  ProgressBar progress(stage, open.size(), "");
  std::map<pid_t, const Task*> running;
  std::size_t next = 0;
  while (next < open.size() || !running.empty()) {
    while (next < open.size() && running.size() < static_cast<std::size_t>(jobs)) {
      running.emplace(Start(*open[next]), open[next]);
      ++next;
    }
    int status = 0;
    const pid_t ended = waitpid(-1, &status, WNOHANG);
    if (ended < 0 && errno == ECHILD) {
      ThrowError("cannot wait for a child process: {}", std::strerror(errno));
    }
    if (interrupt.Requested()) {
      for (const auto& [child, task] : running) kill(child, SIGKILL);
      for (const auto& [child, task] : running) waitpid(child, &status, 0);
      ThrowError(
          "interrupted; finished cells are kept: run the same command with --resume to continue");
    }
    const auto it = running.find(ended);
    if (it == running.end()) {
      progress.Advance(0);
      usleep(20'000);
      continue;
    }
    RecordEnd(*it->second, status);
    progress.Wipe();
    const Json result = ReadJsonFile(it->second->result);
    if (result.at("error").is_null()) {
      spdlog::info("{}: {:.1f} s", it->second->label, result.at("seconds").get<double>());
    } else {
      spdlog::info("{}: FAILED: {}", it->second->label, result.at("error").get<std::string>());
    }
    running.erase(it);
    progress.Advance();
  }
}

}  // namespace cohort
