#include "backend/colmap/program.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <regex>
#include <sstream>

#include "frontend/core/error.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

constexpr const char* kHowToInstall =
    "install it (Debian: apt install colmap) or give --colmap-program PATH";

// A file descriptor, closed at the end of the scope.
class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() { Close(); }
  int get() const { return fd_; }
  void Close() {
    if (fd_ >= 0) close(fd_);
    fd_ = -1;
  }

 private:
  int fd_;
};

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

// Runs a program with output and errors into a descriptor.
ProgramEnd RunInto(const fs::path& program, std::vector<std::string> arguments, int output) {
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
  }
  if (got == sizeof(exec_error)) {
    ThrowError("cannot run {}: {}", program.string(), std::strerror(exec_error));
  }
  if (WIFSIGNALED(status)) return {0, WTERMSIG(status)};
  return {WEXITSTATUS(status), 0};
}

std::string CaptureOutput(const fs::path& program, const std::vector<std::string>& arguments) {
  const std::unique_ptr<std::FILE, int (*)(std::FILE*)> file(std::tmpfile(), &std::fclose);
  if (file == nullptr) ThrowError("cannot make a temporary file: {}", std::strerror(errno));
  RunInto(program, arguments, fileno(file.get()));
  std::rewind(file.get());
  std::string text;
  char buffer[4096];
  while (const std::size_t n = std::fread(buffer, 1, sizeof(buffer), file.get())) {
    text.append(buffer, n);
  }
  return text;
}

}  // namespace

std::string ProgramEnd::Brief() const {
  return signal != 0 ? fmt::format("killed by signal {}", signal)
                     : fmt::format("exit code {}", exit_code);
}

ColmapProgram::ColmapProgram(const std::string& program) {
  const auto found = FindProgram(program);
  if (!found) {
    ThrowError("colmap is not installed ({} is not a program): {}", program, kHowToInstall);
  }
  path_ = *found;
  const std::string help = CaptureOutput(path_, {"-h"});
  std::smatch match;
  if (!std::regex_search(help, match, std::regex(R"(COLMAP\s+v?([0-9][^\s]*))"))) {
    ThrowError("{} is not COLMAP (its -h does not say so): {}", path_.string(), kHowToInstall);
  }
  version_ = match[1];
}

const std::set<std::string>& ColmapProgram::Options(const std::string& command) {
  const auto [it, added] = options_of_command_.try_emplace(command);
  if (added) {
    const std::string help = CaptureOutput(path_, {command, "-h"});
    const std::regex option(R"(--([A-Za-z][A-Za-z0-9_.]*))");
    for (std::sregex_iterator m(help.begin(), help.end(), option), end; m != end; ++m) {
      it->second.insert((*m)[1]);
    }
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
  const Descriptor file(open(log.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666));
  if (file.get() < 0) ThrowError("cannot write {}: {}", log.string(), std::strerror(errno));
  std::string header = fmt::format("$ {} {}\n", path_.string(), fmt::join(line, " "));
  if (!unknown.empty()) header += fmt::format("(not known to this COLMAP:{})\n", unknown);
  if (write(file.get(), header.data(), header.size()) != static_cast<ssize_t>(header.size())) {
    ThrowError("cannot write {}: {}", log.string(), std::strerror(errno));
  }
  return RunInto(path_, line, file.get());
}

}  // namespace cohort
