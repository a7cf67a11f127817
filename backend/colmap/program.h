#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "frontend/core/child_process.h"

namespace cohort {

// An option of a colmap command under all names it has had; the installed program states which it
// knows. An unknown option is left out, or is an Error if required.
struct ColmapArgument {
  std::vector<std::string> names;  // without --
  std::string value;
  bool required = false;
};

// Seeds all random numbers of a command.
ColmapArgument SeedArgument(int seed);

// The installed COLMAP, run by child_process.h.
class ColmapProgram {
 public:
  // A path, or a name looked up in PATH; a run that takes longer than `max_minutes` (0: no limit)
  // is killed. Throws Error with instructions to install COLMAP if there is none or it is another
  // program.
  explicit ColmapProgram(const std::string& program = "colmap", double max_minutes = 0.0);

  const std::filesystem::path& path() const { return path_; }
  const std::string& version() const { return version_; }  // "3.8"

  // The options that `colmap COMMAND -h` lists.
  const std::set<std::string>& Options(const std::string& command);

  // Waits for the end. Appends the command line and all output to `log`. Throws Error if the
  // program was killed at the time limit.
  ProgramEnd Run(const std::string& command,
                 const std::vector<ColmapArgument>& arguments,
                 const std::filesystem::path& log);

 private:
  std::string HelpText(const std::vector<std::string>& arguments) const;

  std::filesystem::path path_;
  double max_minutes_;
  std::string version_;
  std::map<std::string, std::set<std::string>> options_of_command_;
};

// Throws what ColmapProgram's constructor throws; call it before expensive work.
void RequireColmap(const std::string& program, double max_minutes);

}  // namespace cohort
