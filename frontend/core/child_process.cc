#include "frontend/core/child_process.h"

#include <fcntl.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

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

// The environment with Qt kept from looking for a display.
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
  for (std::string& text : texts) pointers.push_back(text.data());
  pointers.push_back(nullptr);
  return pointers;
}

}  // namespace

void Descriptor::Close() {
  if (fd_ >= 0) close(fd_);
  fd_ = -1;
}

std::string ProgramEnd::Brief() const {
  return signal != 0 ? fmt::format("killed by signal {}", signal)
                     : fmt::format("exit code {}", exit_code);
}

std::optional<fs::path> FindProgram(const std::string& program) {
  const auto usable = [](const fs::path& path) {
    return fs::is_regular_file(path) && access(path.c_str(), X_OK) == 0;
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

ProgramEnd RunProgram(const fs::path& program, std::vector<std::string> arguments, int output) {
  arguments.insert(arguments.begin(), program.string());
  std::vector<std::string> environment = ChildEnvironment();
  const std::vector<char*> argv = Pointers(arguments);
  const std::vector<char*> envp = Pointers(environment);
  const Descriptor null(open("/dev/null", O_RDONLY | O_CLOEXEC));
  int pipe_ends[2];  // tells that exec failed; closed by an exec that succeeds
  if (null.get() < 0 || pipe2(pipe_ends, O_CLOEXEC) != 0) {
    ThrowError("cannot run {}: {}", program.string(), std::strerror(errno));
  }
  const Descriptor report_from(pipe_ends[0]);
  Descriptor report_to(pipe_ends[1]);
  const pid_t parent = getpid();
  const pid_t child = fork();
  if (child < 0) ThrowError("cannot run {}: {}", program.string(), std::strerror(errno));
  if (child == 0) {
    // Only calls that are safe after fork in a program with threads.
    prctl(PR_SET_PDEATHSIG, SIGKILL);
    if (getppid() != parent) _exit(127);  // it died before the line above
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
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
    try {
      CheckInterruption();
    } catch (...) {
      kill(child, SIGKILL);
      waitpid(child, &status, 0);
      throw;
    }
  }
  CheckInterruption();
  if (got == sizeof(exec_error)) {
    ThrowError("cannot run {}: {}", program.string(), std::strerror(exec_error));
  }
  if (WIFSIGNALED(status)) return {0, WTERMSIG(status)};
  return {WEXITSTATUS(status), 0};
}

ProgramOutput RunProgramForText(const fs::path& program, std::vector<std::string> arguments) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::tmpfile(), &std::fclose);
  if (file == nullptr) ThrowError("cannot make a temporary file: {}", std::strerror(errno));
  ProgramOutput result;
  result.end = RunProgram(program, std::move(arguments), fileno(file.get()));
  std::rewind(file.get());
  char buffer[4096];
  while (const std::size_t n = std::fread(buffer, 1, sizeof(buffer), file.get())) {
    result.text.append(buffer, n);
  }
  return result;
}

}  // namespace cohort
