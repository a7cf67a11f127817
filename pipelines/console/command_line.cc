#include "pipelines/console/command_line.h"

#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>
#include <sstream>

#include "frontend/storage/input_record.h"
#include "pipelines/json/json_file.h"

namespace cohort {
namespace {

// An option of the command line: one flag for one or several entries.
struct DeclaredOption {
  std::vector<const OptionEntry*> entries;
  std::string given_as;  // in messages
  OptionHelp help;
};

const OptionEntry& EntryAt(const std::vector<OptionEntry>& entries, const std::string& path) {
  const auto found = std::find_if(
      entries.begin(), entries.end(), [&](const OptionEntry& e) { return e.path == path; });
  Check(found != entries.end(), "a command names options that it has");
  return *found;
}

bool IsPositional(const CommandLine& line, const std::string& path) {
  return std::count(line.positionals.begin(), line.positionals.end(), path) > 0;
}

// "What it does. (1 to 9; default 5)"
std::string Description(const OptionEntry& entry) {
  const OptionValue value = entry.get();
  const std::string text = ToText(value);
  std::string notes;
  if (!entry.allowed.empty()) notes = entry.allowed;
  if (!text.empty()) notes += (notes.empty() ? "default " : "; default ") + text;
  return notes.empty() ? entry.help : fmt::format("{} ({})", entry.help, notes);
}

OptionHelp::Value ValueOf(const OptionEntry& entry) {
  if (!entry.choices.empty()) return OptionHelp::Value::kChoice;
  constexpr OptionHelp::Value kValues[] = {OptionHelp::Value::kNone,
                                           OptionHelp::Value::kNumber,
                                           OptionHelp::Value::kNumber,
                                           OptionHelp::Value::kText,
                                           OptionHelp::Value::kList};
  return kValues[entry.get().index()];
}

DeclaredOption DeclarePositional(const OptionEntry& entry) {
  return {{&entry},
          entry.path,
          {{entry.path}, entry.path, Description(entry), ValueOf(entry), entry.choices}};
}

DeclaredOption DeclareEntry(const CommandLine& line, const OptionEntry& entry) {
  std::vector<std::string> names{"--" + FlagName(entry.path)};
  for (const ShortFlag& flag : line.short_flags) {
    if (flag.paths == std::vector{entry.path}) names.insert(names.begin(), "--" + flag.name);
  }
  const bool has_short_flag = names.size() > 1;
  std::string left = fmt::format("{}", fmt::join(names, ", "));
  const OptionValue value = entry.get();
  if (const bool* flag = std::get_if<bool>(&value); flag != nullptr && *flag) {
    left.insert(2, "[no-]");
  }
  return {{&entry},
          names.front(),
          {names,
           left,
           Description(entry),
           ValueOf(entry),
           entry.choices,
           has_short_flag ? "" : entry.group,
           has_short_flag ? Tier::kCommon : entry.tier}};
}

// A short flag for several entries.
DeclaredOption DeclareShortFlag(const std::vector<OptionEntry>& entries, const ShortFlag& flag) {
  std::vector<const OptionEntry*> targets;
  std::vector<std::string> names;
  for (const std::string& path : flag.paths) {
    targets.push_back(&EntryAt(entries, path));
    names.push_back("--" + FlagName(path));
  }
  const std::string name = "--" + flag.name;
  return {targets,
          name,
          {{name},
           name,
           fmt::format("{} (sets {})", flag.help, fmt::join(names, " and ")),
           ValueOf(*targets.front())}};
}

// Later options overwrite earlier ones, so the full name of an option takes precedence over a flag
// for several.
std::vector<DeclaredOption> DeclareOptions(const CommandLine& line,
                                           const std::vector<OptionEntry>& entries) {
  std::vector<DeclaredOption> options;
  for (const std::string& path : line.positionals) {
    options.push_back(DeclarePositional(EntryAt(entries, path)));
  }
  for (const ShortFlag& flag : line.short_flags) {
    if (flag.paths.size() > 1) options.push_back(DeclareShortFlag(entries, flag));
  }
  for (const OptionEntry& entry : entries) {
    if (!IsPositional(line, entry.path)) options.push_back(DeclareEntry(line, entry));
  }
  return options;
}

// The options that every command has.
const std::vector<OptionHelp>& SharedOptions() {
  using Value = OptionHelp::Value;
  static const std::vector<OptionHelp> kOptions{
      {{"--config"},
       "--config",
       "Read options from this JSON file, in the form that --dump-config prints; flags override "
       "it.",
       Value::kText},
      {{"--dump-config"}, "--dump-config", "Print all options as JSON and exit.", Value::kNone},
      {{"--quiet"},
       "--quiet",
       "Show only warnings and errors, no log and no progress bar.",
       Value::kNone},
      {{"--help", "--help-all"},
       "--help",
       "Print the common options and exit; --help-all prints all options.",
       Value::kNone}};
  return kOptions;
}

CLI::Option* Bind(CLI::App& app, const DeclaredOption& option) {
  const OptionHelp& help = option.help;
  const std::string names = fmt::format("{}", fmt::join(help.names, ","));
  if (help.value == OptionHelp::Value::kNone) {
    return app.add_flag(names + ",!--no-" + help.names.front().substr(2));
  }
  CLI::Option* bound = app.add_option(names, [](const CLI::results_t&) { return true; });
  if (!help.IsPositional()) {
    return bound->type_name("value")->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
  }
  if (help.value == OptionHelp::Value::kList) {
    bound->expected(1, CLI::detail::expected_max_vector_size)->allow_extra_args();
  }
  return bound;
}

std::string HelpLine(const std::string& left, const std::string& description) {
  constexpr std::size_t kLeftWidth = 30;
  constexpr std::size_t kWidth = 100;
  std::string text = fmt::format("  {:<{}}", left, kLeftWidth - 2);
  std::size_t column = text.size();
  if (column > kLeftWidth) {
    text += fmt::format("\n{:{}}", "", kLeftWidth);
    column = kLeftWidth;
  }
  std::istringstream words(description);
  for (std::string word; words >> word;) {
    if (column + 1 + word.size() > kWidth) {
      text += fmt::format("\n{:{}}", "", kLeftWidth);
      column = kLeftWidth;
    }
    text += " " + word;
    column += 1 + word.size();
  }
  return text + "\n";
}

std::string HelpHead(const CommandLine& line) {
  return fmt::format("{}.\n\nUsage: cohort {} {}\n\n", line.summary, line.name, line.usage);
}

std::string CommonHelp(const CommandLine& line, const std::vector<OptionHelp>& options) {
  std::string text = HelpHead(line);
  std::size_t others = 0;
  for (const OptionHelp& option : options) {
    if (option.tier == Tier::kCommon) {
      text += HelpLine(option.left, option.text);
    } else {
      ++others;
    }
  }
  if (others > 0) {
    text += fmt::format("\n'cohort {} --help-all' lists the other {} too.\n", line.name, others);
  }
  return text;
}

std::string FullHelp(const CommandLine& line, const std::vector<OptionHelp>& options) {
  std::string text = HelpHead(line);
  for (const OptionHelp& option : options) {
    if (option.group.empty()) text += HelpLine(option.left, option.text);
  }
  std::string group;
  for (const OptionHelp& option : options) {
    if (option.group.empty()) continue;
    if (option.group != group) text += fmt::format("\n{}:\n", option.group);
    group = option.group;
    text += HelpLine(option.left, option.text);
  }
  return text;
}

// Number of single-letter edits between two words.
std::size_t EditDistance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), 0);
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = std::exchange(row[0], i);
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0 : 1)});
      diagonal = above;
    }
  }
  return row.back();
}

[[noreturn]] void ThrowUnexpected(const CLI::App& app,
                                  const CommandLine& line,
                                  const std::string& argument) {
  if (!argument.starts_with("-")) {
    ThrowUsageError(
        "unexpected argument '{}': usage is cohort {} {}", argument, line.name, line.usage);
  }
  const std::string flag = argument.substr(0, argument.find('='));
  std::string nearest;
  std::size_t nearest_distance = flag.size() / 2;
  for (const CLI::Option* option : app.get_options()) {
    for (const std::string& name : option->get_lnames()) {
      const std::size_t distance = EditDistance(flag, "--" + name);
      if (distance < nearest_distance) {
        nearest_distance = distance;
        nearest = "--" + name;
      }
    }
  }
  ThrowUsageError("unknown option {}: {}'cohort {} --help-all' lists all",
                  flag,
                  nearest.empty() ? "" : fmt::format("did you mean {}? ", nearest),
                  line.name);
}

void Apply(const DeclaredOption& option, const CLI::results_t& results) {
  if (results.empty()) return;
  for (const OptionEntry* entry : option.entries) {
    if (option.help.IsPositional() && option.help.value == OptionHelp::Value::kList) {
      entry->set(results, option.given_as);
    } else {
      SetFromText(*entry, results.back(), option.given_as);
    }
  }
}

}  // namespace

std::string FlagName(std::string path) {
  std::replace(path.begin(), path.end(), '_', '-');
  return path;
}

std::vector<OptionHelp> HelpOfOptions(const CommandLine& line,
                                      const std::vector<OptionEntry>& entries) {
  std::vector<OptionHelp> help;
  for (DeclaredOption& option : DeclareOptions(line, entries)) {
    help.push_back(std::move(option.help));
  }
  help.insert(help.end(), SharedOptions().begin(), SharedOptions().end());
  return help;
}

ParseOutcome ParseCommandLine(const CommandLine& line,
                              const std::vector<OptionEntry>& entries,
                              std::span<const std::string> arguments) {
  CLI::App app;
  app.allow_extras();
  app.set_help_flag();

  const std::vector<DeclaredOption> options = DeclareOptions(line, entries);
  std::vector<CLI::Option*> bound;
  for (const DeclaredOption& option : options) bound.push_back(Bind(app, option));
  std::string config;
  bool dump_config = false;
  bool quiet = false;
  bool help = false;
  bool help_all = false;
  app.add_option("--config", config);
  app.add_flag("--dump-config", dump_config);
  app.add_flag("--quiet", quiet);
  app.add_flag("-h,--help", help);
  app.add_flag("--help-all", help_all);

  // CLI11 would take the next word as the value, even if it is an option: `--json=$UNSET --quiet`
  // would write a file --quiet.
  for (const std::string& word : arguments) {
    if (word == "--") break;
    if (word.starts_with("--") && word.find('=') == word.size() - 1) {
      ThrowUsageError("{} has no value: give one, or leave the option out", word);
    }
  }
  std::vector<std::string> words(arguments.rbegin(), arguments.rend());
  // CLI11 takes a word in brackets as a list; with "./" in front it denotes the same file.
  for (std::string& word : words) {
    if (word.starts_with('[') && word.ends_with(']')) word.insert(0, "./");
  }
  try {
    app.parse(std::move(words));
  } catch (const CLI::ParseError& e) {
    ThrowUsageError("{}: 'cohort {} --help-all' lists all options", e.what(), line.name);
  }
  if (help || help_all) {
    const std::vector<OptionHelp> listed = HelpOfOptions(line, entries);
    fmt::print("{}", help_all ? FullHelp(line, listed) : CommonHelp(line, listed));
    return ParseOutcome::kDone;
  }
  std::vector<std::string> left = app.remaining();
  std::erase(left, "--");  // the words after it are positional and have been parsed as such
  if (!left.empty()) ThrowUnexpected(app, line, left.front());

  if (!config.empty()) {
    SetFromJson(entries, ReadJsonFile(config), config);
    InputRecord::Add(config);
  }
  for (std::size_t i = 0; i < options.size(); ++i) Apply(options[i], bound[i]->results());
  if (quiet) spdlog::set_level(spdlog::level::warn);
  if (dump_config) {
    fmt::print(
        "{}\n",
        OptionsToJson(entries).dump(2, ' ', false, nlohmann::json::error_handler_t::replace));
    return ParseOutcome::kDone;
  }
  for (const std::string& path : line.required) {
    if (ToText(EntryAt(entries, path).get()).empty()) {
      ThrowUsageError("{} is missing: usage is cohort {} {}",
                      IsPositional(line, path) ? path : "--" + FlagName(path),
                      line.name,
                      line.usage);
    }
  }
  return ParseOutcome::kRun;
}

}  // namespace cohort
