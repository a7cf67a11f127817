#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "frontend/core/child_process.h"

namespace cohort {

// An option of a colmap command under all names it has had; the installed program says which it
// knows. One that it does not know is left out, unless required: then that is an Error.
struct ColmapArgument {
  std::vector<std::string> names;  // without --
  std::string value;
  bool required = false;
};

// Of all random numbers of a command.
ColmapArgument SeedArgument(int seed);

// The installed COLMAP, run as child_process.h says.
class ColmapProgram {
 public:
  // A path, or a name looked up in PATH; a run that takes longer than `max_minutes` (0: no limit) is
  // killed. Throws Error saying how to get COLMAP where there is none or the program is another.
  explicit ColmapProgram(const std::string& program = "colmap", double max_minutes = 0.0);

  const std::filesystem::path& path() const { return path_; }
  const std::string& version() const { return version_; }  // "3.8"

  // The options that `colmap COMMAND -h` lists.
  const std::set<std::string>& Options(const std::string& command);

  // Waits for the end. Appends the command line and all it prints to `log`. Throws Error where it
  // was killed at the time limit.
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

// Throws what ColmapProgram's constructor does: before work that would be for nothing.
void RequireColmap(const std::string& program, double max_minutes);

}  // namespace cohort
