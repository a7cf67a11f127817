#include "frontend/core/child_process.h"

#include <fcntl.h>
#include <poll.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <sstream>

#include "frontend/core/error.h"
#include "frontend/core/interruption.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

// The environment, with Qt prevented from looking for a display.
std::vector<std::string> ChildEnvironment() {
  std::vector<std::string> result;
  for (char** entry = environ; *entry != nullptr; ++entry) {
    if (std::strncmp(*entry, "QT_QPA_PLATFORM=", 16) != 0) result.emplace_back(*entry);
  }
  result.emplace_back("QT_QPA_PLATFORM=offscreen");
  return result;
}

std::vector<char*> Pointers(std::vector<std::string>& texts) {
  std::vector<char*> pointers;
  pointers.reserve(texts.size() + 1);
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

// While SIGCHLD is ignored, as under some job runners, the exit status of a child is not available.
class EndIsTold {
 public:
  EndIsTold() {
    sigaction(SIGCHLD, nullptr, &before_);
    if (before_.sa_handler == SIG_IGN) signal(SIGCHLD, SIG_DFL);
  }
  EndIsTold(const EndIsTold&) = delete;
  EndIsTold& operator=(const EndIsTold&) = delete;
  ~EndIsTold() {
    if (before_.sa_handler == SIG_IGN) signal(SIGCHLD, SIG_IGN);
  }

 private:
  struct sigaction before_ {};
};

// The limits beyond which a program is killed.
struct Limits {
  std::chrono::duration<double> time;  // zero: never
  off_t output_bytes;                  // of a file into which it prints
};

off_t BytesIn(int output) {
  struct stat status {};
  return fstat(output, &status) == 0 && S_ISREG(status.st_mode) ? status.st_size : 0;
}

// Waits for the child's end; kills it at its limits, or if the check for interruptions throws.
// Polls up to 20 times a second, more often at first, because most calls are short.
ProgramEnd WaitFor(pid_t child, int output, const Limits& limits) {
  const auto start = std::chrono::steady_clock::now();
  const off_t before = BytesIn(output);
  const auto kill_and_wait = [child] {
    int status = 0;
    kill(child, SIGKILL);
    while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
    }
  };
  int status = 0;
  for (int pause_ms = 1;; pause_ms = std::min(2 * pause_ms, 50)) {
    const pid_t ended = waitpid(child, &status, WNOHANG);
    if (ended == child) break;
    if (ended < 0 && errno != EINTR) {
      ThrowError("cannot wait for a child process: {}", std::strerror(errno));
    }
    if (limits.time.count() > 0.0 && std::chrono::steady_clock::now() - start > limits.time) {
      kill_and_wait();
      return {.signal = SIGKILL, .out_of_time = true};
    }
    if (BytesIn(output) - before > limits.output_bytes) {
      kill_and_wait();
      return {.signal = SIGKILL, .printed_too_much = true};
    }
    try {
      CheckInterruption();
    } catch (...) {
      kill_and_wait();
      throw;
    }
    poll(nullptr, 0, pause_ms);
  }
  if (WIFSIGNALED(status)) return {.signal = WTERMSIG(status)};
  return {.exit_code = WEXITSTATUS(status)};
}

ProgramEnd RunWithin(const Limits& limits,
                     const fs::path& program,
                     std::vector<std::string> arguments,
                     int output) {
  arguments.insert(arguments.begin(), program.string());
  std::vector<std::string> environment = ChildEnvironment();
  const std::vector<char*> argv = Pointers(arguments);
  const std::vector<char*> envp = Pointers(environment);
  const Descriptor null(open("/dev/null", O_RDONLY | O_CLOEXEC));
  int pipe_ends[2];  // reports that exec failed; closed by a successful exec
  if (null.get() < 0 || pipe2(pipe_ends, O_CLOEXEC) != 0) {
    ThrowError("cannot run {}: {}", program.string(), std::strerror(errno));
  }
  const Descriptor report_from(pipe_ends[0]);
  Descriptor report_to(pipe_ends[1]);
  const EndIsTold told;
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child < 0) ThrowError("cannot run {}: {}", program.string(), std::strerror(errno));
  if (child == 0) {
    // Only calls that are safe after a fork in a multi-threaded program.
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    signal(SIGPIPE, SIG_DFL);  // we ignore it, but other programs rely on it
    signal(SIGXFSZ, SIG_DFL);
    if (getppid() != parent) _exit(127);  // the parent died before the prctl above
    dup2(null.get(), STDIN_FILENO);
    dup2(output, STDOUT_FILENO);
    dup2(output, STDERR_FILENO);
    execve(argv[0], argv.data(), envp.data());
    const int error = errno;
    [[maybe_unused]] const auto written = write(report_to.get(), &error, sizeof(error));
    _exit(127);
  }
  report_to.Close();
  int exec_error = 0;
  ssize_t got = 0;
  do {
    got = read(report_from.get(), &exec_error, sizeof(exec_error));
  } while (got < 0 && errno == EINTR);
  const ProgramEnd end = WaitFor(child, output, limits);
  CheckInterruption();
  if (got == sizeof(exec_error)) {
    ThrowError("cannot run {}: {}", program.string(), std::strerror(exec_error));
  }
  return end;
}

}  // namespace

std::string ProgramEnd::Brief() const {
  if (out_of_time) return "killed at its time limit";
  if (printed_too_much) return "killed as it printed without end";
  return signal != 0 ? fmt::format("killed by signal {}", signal)
                     : fmt::format("exit code {}", exit_code);
}

std::optional<fs::path> FindProgram(const std::string& program) {
  const auto usable = [](const fs::path& path) {
    std::error_code ignored;  // of a folder without permission, such as another user's
    return fs::is_regular_file(path, ignored) && access(path.c_str(), X_OK) == 0;
  };
  if (program.find('/') != std::string::npos) {
    return usable(program) ? std::optional(fs::absolute(program)) : std::nullopt;
  }
  const char* path = std::getenv("PATH");
  std::istringstream folders(path != nullptr ? path : "/usr/local/bin:/usr/bin:/bin");
  for (std::string folder; std::getline(folders, folder, ':');) {
    const fs::path candidate = fs::path(folder.empty() ? "." : folder) / program;
    if (usable(candidate)) return fs::absolute(candidate);
  }
  return std::nullopt;
}

ProgramEnd RunProgram(const fs::path& program,
                      std::vector<std::string> arguments,
                      int output,
                      std::chrono::duration<double> time_limit) {
  return RunWithin({time_limit, off_t{1} << 30}, program, std::move(arguments), output);
}

ProgramOutput RunProgramForText(const fs::path& program,
                                std::vector<std::string> arguments,
                                std::chrono::duration<double> time_limit) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::tmpfile(), &std::fclose);
  if (file == nullptr) ThrowError("cannot make a temporary file: {}", std::strerror(errno));
  // The child gets copies of it as 1 and 2. If it were one of those itself, as is possible in
  // Python, it would be closed there.
  const Descriptor output(fcntl(fileno(file.get()), F_DUPFD_CLOEXEC, STDERR_FILENO + 1));
  fcntl(fileno(file.get()), F_SETFD, FD_CLOEXEC);
  if (output.get() < 0) ThrowError("cannot run {}: {}", program.string(), std::strerror(errno));
  constexpr std::size_t kMostBytes = std::size_t{1} << 24;
  ProgramOutput result;
  result.end = RunWithin({time_limit, kMostBytes}, program, std::move(arguments), output.get());
  std::rewind(file.get());
  char buffer[4096];
  while (const std::size_t n = std::fread(buffer, 1, sizeof(buffer), file.get())) {
    result.text.append(buffer, n);
    if (result.text.size() >= kMostBytes) break;
  }
  return result;
}

}  // namespace cohort
