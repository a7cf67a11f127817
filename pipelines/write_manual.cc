// write_manual FOLDER: writes the manual pages and the shell completions of the program, with the
// contents of --help, into the folders below share/ in which programs search for them.

#include <fmt/format.h>

#include <filesystem>

#include "frontend/storage/output.h"
#include "pipelines/commands/all_commands.h"
#include "pipelines/console/completion.h"
#include "pipelines/console/manual.h"

namespace fs = std::filesystem;

int main(int argc, char** argv) try {
  if (argc != 2) {
    fmt::print(stderr, "usage: write_manual FOLDER\n");
    return 2;
  }
  const fs::path folder = argv[1];
  const auto write = [&folder](const fs::path& name, const std::string& text) {
    fs::create_directories((folder / name).parent_path());
    cohort::WriteBytes(folder / name, text);
  };
  const std::vector<cohort::Command> commands = cohort::AllCommands();
  write("man/man1/cohort.1", cohort::ManualOfProgram(commands));
  for (const cohort::Command& command : commands) {
    write("man/man1/cohort-" + command.name + ".1", cohort::ManualOfCommand(command));
  }
  write("bash-completion/completions/cohort", cohort::BashCompletion(commands));
  write("zsh/_cohort", cohort::ZshCompletion(commands));
  write("fish/vendor_completions.d/cohort.fish", cohort::FishCompletion(commands));
  return 0;
} catch (const std::exception& error) {
  fmt::print(stderr, "write_manual: error: {}\n", error.what());
  return 1;
}
