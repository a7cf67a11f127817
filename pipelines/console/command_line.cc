#include "pipelines/console/command_line.h"

#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>

#include "pipelines/console/json_file.h"

namespace cohort {
namespace {

struct BoundOption {
  CLI::Option* option;
  std::vector<const OptionEntry*> entries;
  std::string given_as;
};

std::string FlagName(std::string path) {
  std::replace(path.begin(), path.end(), '_', '-');
  return path;
}

const OptionEntry& EntryAt(const std::vector<OptionEntry>& entries, const std::string& path) {
  const auto found = std::find_if(
      entries.begin(), entries.end(), [&](const OptionEntry& e) { return e.path == path; });
  Check(found != entries.end(), "a command names options that it has");
  return *found;
}

bool IsPositional(const CommandLine& line, const std::string& path) {
  return std::count(line.positionals.begin(), line.positionals.end(), path) > 0;
}

std::string Description(const OptionEntry& entry) {
  const OptionValue value = entry.get();
  const std::string text = ToText(value);
  std::string notes;
  if (!entry.allowed.empty()) notes = entry.allowed;
  if (!text.empty()) notes += (notes.empty() ? "default " : "; default ") + text;
  return notes.empty() ? entry.help : fmt::format("{} ({})", entry.help, notes);
}

// `names` without dashes.
CLI::Option* AddOption(CLI::App& app, const OptionEntry& entry, std::vector<std::string> names) {
  const bool is_flag = std::holds_alternative<bool>(entry.get());
  std::string joined;
  for (const std::string& name : names) {
    if (!joined.empty()) joined += ",";
    joined += "--" + name;
  }
  if (is_flag) joined += ",!--no-" + names.front();
  const std::string description = Description(entry);
  if (is_flag) return app.add_flag(joined, description);
  return app
      .add_option(
          joined, [](const CLI::results_t&) { return true; }, description)
      ->type_name("")
      ->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
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
        "unexpected argument '{}': the form is cohort {} {}", argument, line.name, line.usage);
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
  ThrowUsageError("unknown option {}: {}'cohort {} --help' lists all",
                  flag,
                  nearest.empty() ? "" : fmt::format("did you mean {}? ", nearest),
                  line.name);
}

void Apply(const BoundOption& bound) {
  const auto& results = bound.option->results();
  if (results.empty()) return;
  for (const OptionEntry* entry : bound.entries) {
    if (std::holds_alternative<std::vector<std::string>>(entry->get()) &&
        bound.option->get_positional()) {
      entry->set(results, bound.given_as);
    } else {
      SetFromText(*entry, results.back(), bound.given_as);
    }
  }
}

}  // namespace

ParseOutcome ParseCommandLine(const CommandLine& line,
                              const std::vector<OptionEntry>& entries,
                              std::span<const std::string> arguments) {
  CLI::App app(line.summary);
  app.allow_extras();
  app.set_help_flag("-h,--help", "print this help");
  app.get_formatter()->column_width(38);

  std::vector<BoundOption> bound;
  for (const std::string& path : line.positionals) {
    const OptionEntry& entry = EntryAt(entries, path);
    CLI::Option* option =
        app.add_option(
               path, [](const CLI::results_t&) { return true; }, Description(entry))
            ->type_name("");
    if (std::holds_alternative<std::vector<std::string>>(entry.get())) {
      option->expected(0, CLI::detail::expected_max_vector_size);
    }
    bound.push_back({option, {&entry}, path});
  }
  for (const ShortFlag& flag : line.short_flags) {
    if (flag.paths.size() == 1) continue;
    std::vector<const OptionEntry*> targets;
    std::vector<std::string> names;
    for (const std::string& path : flag.paths) {
      targets.push_back(&EntryAt(entries, path));
      names.push_back("--" + FlagName(path));
    }
    CLI::Option* option = AddOption(app, *targets.front(), {flag.name});
    option->description(fmt::format("the same as all of {}", fmt::join(names, ", ")));
    bound.push_back({option, targets, "--" + flag.name});
  }
  for (const OptionEntry& entry : entries) {
    if (IsPositional(line, entry.path)) continue;
    const std::string full_name = FlagName(entry.path);
    std::vector<std::string> names{full_name};
    for (const ShortFlag& flag : line.short_flags) {
      if (flag.paths == std::vector{entry.path}) names.insert(names.begin(), flag.name);
    }
    CLI::Option* option = AddOption(app, entry, names);
    if (names.size() == 1 && !entry.group.empty()) {
      option->group(fmt::format(
          "{} (--{}.*)", entry.group, full_name.substr(0, full_name.find_last_of('.'))));
    }
    bound.push_back({option, {&entry}, "--" + names.front()});
  }
  std::string config;
  bool dump_config = false;
  bool quiet = false;
  app.add_option("--config", config, "JSON file of options; flags override it")->type_name("");
  app.add_flag("--dump-config", dump_config, "print all options as JSON for --config, and end");
  app.add_flag("--quiet", quiet, "no log and no progress bar, only warnings and errors");

  try {
    app.parse(std::vector<std::string>(arguments.rbegin(), arguments.rend()));
  } catch (const CLI::CallForHelp&) {
    fmt::print(
        "Usage: cohort {} {}\n{}", line.name, line.usage, app.help("", CLI::AppFormatMode::Sub));
    return ParseOutcome::kDone;
  } catch (const CLI::ParseError& e) {
    ThrowUsageError("{}: 'cohort {} --help' lists all options", e.what(), line.name);
  }
  if (!app.remaining().empty()) ThrowUnexpected(app, line, app.remaining().front());

  if (!config.empty()) SetFromJson(entries, ReadJsonFile(config), config);
  for (const BoundOption& option : bound) Apply(option);
  if (quiet) spdlog::set_level(spdlog::level::warn);
  if (dump_config) {
    fmt::print("{}\n", OptionsToJson(entries).dump(2));
    return ParseOutcome::kDone;
  }
  for (const std::string& path : line.required) {
    if (ToText(EntryAt(entries, path).get()).empty()) {
      ThrowUsageError("{} is missing: the form is cohort {} {}",
                      IsPositional(line, path) ? path : "--" + FlagName(path),
                      line.name,
                      line.usage);
    }
  }
  return ParseOutcome::kRun;
}

}  // namespace cohort
