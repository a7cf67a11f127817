#pragma once

#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "pipelines/json/option_list.h"

namespace cohort {

// A short name of options on the command line, besides their full ones: {"features",
// {"detector.max_features"}} gives --features. With several paths it sets all of them, and has its
// own help. An option with a short name is common, whatever its tier.
struct ShortFlag {
  std::string name;
  std::vector<std::string> paths;
  std::string help = {};
};

// The syntax of a command. `positionals` are paths given without a flag, in this order; a list
// takes all the rest.
struct CommandLine {
  std::string name;
  std::string usage;    // what follows the name, "INPUT --out F.tracks [options]"
  std::string summary;  // one line
  std::vector<std::string> positionals = {};
  std::vector<std::string> required = {};  // paths that must not stay empty
  std::vector<ShortFlag> short_flags = {};
};

// An option as --help-all shows it.
struct OptionHelp {
  enum class Value { kNone, kNumber, kChoice, kList, kText };

  std::vector<std::string> names;  // {"--window", "--klt.window-px"}; {"input"}: a positional
  std::string left;                // the same as --help shows it, "--[no-]robust"
  std::string text;                // "What it does. (1 to 9; default 5)"
  Value value = Value::kText;
  std::vector<std::string> choices = {};
  std::string group = {};  // its heading; empty: above all headings
  Tier tier = Tier::kCommon;

  bool IsPositional() const { return !names.front().starts_with('-'); }
};

// The name of an entry on the command line, without dashes.
std::string FlagName(std::string path);

// All options of a command in their order, including the general ones.
std::vector<OptionHelp> HelpOfOptions(const CommandLine& line,
                                      const std::vector<OptionEntry>& entries);

enum class ParseOutcome {
  kRun,
  kDone,  // --help, --help-all or --dump-config has been printed
};

// Sets the options behind `entries`: defaults < --config F.json < flags. Every entry gets a flag
// --group.some-name from its path group.some_name (--no-... too if it is boolean). Throws
// UsageError naming the flag and the nearest known one, or the valid values. --quiet restricts the
// log to warnings and errors. --help lists the common options, --help-all all.
ParseOutcome ParseCommandLine(const CommandLine& line,
                              const std::vector<OptionEntry>& entries,
                              std::span<const std::string> arguments);

}  // namespace cohort
