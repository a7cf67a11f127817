#include "pipelines/console/completion.h"

#include <functional>
#include <string_view>

namespace cohort {
namespace {

using Value = OptionHelp::Value;

// The flags of one tier; for an option that is on by default, the flag that turns it off.
struct Flag {
  std::string name;
  const OptionHelp* option;
};

std::vector<Flag> FlagsOf(const Command& command, Tier tier) {
  std::vector<Flag> flags;
  for (const OptionHelp& option : command.options) {
    if (option.IsPositional() || option.tier != tier) continue;
    const bool is_on = option.left.starts_with("--[no-]");
    for (const std::string& name : option.names) {
      const bool is_first = name == option.names.front();
      flags.push_back({is_on && is_first ? "--no-" + name.substr(2) : name, &option});
    }
  }
  return flags;
}

// The first sentence, for which the menu of a shell has room.
std::string Brief(const std::string& text) {
  std::string brief = text;
  for (const std::string_view end : {". ", " (", ": ", "; "})
    brief.resize(std::min(brief.size(), brief.find(end)));
  if (brief.ends_with('.')) brief.pop_back();
  return brief;
}

// In single quotes; `quote` is the shell's form of a quote within them.
std::string Quoted(std::string_view text, std::string_view quote) {
  std::string quoted = "'";
  for (const char c : text) {
    if (c == '\'') {
      quoted += quote;
    } else {
      quoted += c;
    }
  }
  return quoted + "'";
}

std::string ForZsh(std::string_view text) { return Quoted(text, "'\\''"); }
std::string ForFish(std::string_view text) { return Quoted(text, "\\'"); }

// The names of the options with such a value, as a pattern of `case`.
std::string PatternOf(const Command& command, const std::function<bool(const OptionHelp&)>& takes) {
  std::vector<std::string> names;
  for (const OptionHelp& option : command.options) {
    if (option.IsPositional() || !takes(option)) continue;
    names.insert(names.end(), option.names.begin(), option.names.end());
  }
  return fmt::format("{}", fmt::join(names, "|"));
}

bool TakesUnknown(const OptionHelp& option) {
  return option.value == Value::kNumber || option.value == Value::kList;
}

bool TakesText(const OptionHelp& option) { return option.value == Value::kText; }

// `case $before in` of bash and zsh: offers choices, nothing for a number, and files for a text.
// `choices` has the placeholder {} for the words.
std::string CaseOfValues(const Command& command,
                         fmt::format_string<std::string> choices,
                         std::string_view files) {
  std::string text = "      case $before in\n";
  for (const OptionHelp& option : command.options) {
    if (option.IsPositional() || option.value != Value::kChoice) continue;
    text += fmt::format("        {})\n          {}\n          return ;;\n",
                        fmt::join(option.names, "|"),
                        fmt::format(choices, fmt::format("{}", fmt::join(option.choices, " "))));
  }
  if (const std::string names = PatternOf(command, TakesUnknown); !names.empty()) {
    text += fmt::format("        {})\n          return ;;\n", names);
  }
  text += fmt::format(
      "        {})\n          {}\n          return ;;\n", PatternOf(command, TakesText), files);
  return text + "      esac\n";
}

std::string Names(const std::vector<Flag>& flags) {
  std::string names;
  for (const Flag& flag : flags) names += (names.empty() ? "" : " ") + flag.name;
  return names;
}

}  // namespace

std::string BashCompletion(const std::vector<Command>& commands) {
  std::string names;
  for (const Command& command : commands) names += command.name + " ";
  std::string text = fmt::format(
      R"(# bash completion of cohort, made by write_manual of what --help knows.
_cohort_files() {{
  compopt -o filenames 2>/dev/null
  mapfile -t COMPREPLY < <(compgen -f -- "$current")
}}

_cohort() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD - 1]}}
  local common='' others=''
  # --option=value comes as three words.
  if [[ $current == '=' ]]; then
    current=''
  elif [[ $before == '=' ]]; then
    before=${{COMP_WORDS[COMP_CWORD - 2]}}
  fi
  COMPREPLY=()
  if ((COMP_CWORD == 1)); then
    mapfile -t COMPREPLY < <(compgen -W '{}--help --version' -- "$current")
    return
  fi
  case ${{COMP_WORDS[1]}} in
)",
      names);
  for (const Command& command : commands) {
    text += fmt::format(
        "    {})\n{}      common='{}'\n      others='{}' ;;\n",
        command.name,
        CaseOfValues(
            command, "mapfile -t COMPREPLY < <(compgen -W '{}' -- \"$current\")", "_cohort_files"),
        Names(FlagsOf(command, Tier::kCommon)),
        Names(FlagsOf(command, Tier::kExpert)));
  }
  return text + R"(    *) return ;;
  esac
  case $current in
    - | --) mapfile -t COMPREPLY < <(compgen -W "$common" -- "$current") ;;
    -*) mapfile -t COMPREPLY < <(compgen -W "$common $others" -- "$current") ;;
    *) _cohort_files ;;
  esac
}

complete -F _cohort cohort
)";
}

std::string ZshCompletion(const std::vector<Command>& commands) {
  const auto described = [](const std::vector<Flag>& flags) {
    std::string lines;
    for (const Flag& flag : flags) {
      lines += "        " + ForZsh(flag.name + ":" + Brief(flag.option->text)) + "\n";
    }
    return lines;
  };
  std::string text = R"(#compdef cohort
# zsh completion of cohort, made by write_manual of what --help knows.
local -a commands common others
local before=${words[CURRENT - 1]}
if [[ $PREFIX == --*=* ]]; then
  before=${PREFIX%%=*}
  compset -P '*='
fi
commands=(
)";
  for (const Command& command : commands) {
    text += "  " + ForZsh(command.name + ":" + command.summary) + "\n";
  }
  text += R"()
if (( CURRENT == 2 )); then
  if [[ $PREFIX == -* ]]; then
    compadd -- --help --version
  else
    _describe command commands
  fi
  return
fi
case $words[2] in
)";
  for (const Command& command : commands) {
    text += fmt::format("    {})\n{}      common=(\n{}      )\n      others=(\n{}      ) ;;\n",
                        command.name,
                        CaseOfValues(command, "compadd -- {}", "_files"),
                        described(FlagsOf(command, Tier::kCommon)),
                        described(FlagsOf(command, Tier::kExpert)));
  }
  return text + R"(    *) return ;;
esac
case $PREFIX in
  -|--) _describe -o option common ;;
  -*) _describe -o option common -- others ;;
  *) _files ;;
esac
)";
}

std::string FishCompletion(const std::vector<Command>& commands) {
  std::string text = R"(# fish completion of cohort, made by write_manual of what --help knows.
function __cohort_begins
    test (count (commandline -opc)) -eq 1
end
function __cohort_does
    set -l words (commandline -opc)
    test (count $words) -gt 1; and test $words[2] = $argv[1]
end
function __cohort_asks
    string match -qr -- '^--.' (commandline -ct)
end
complete -c cohort -n __cohort_begins -f
complete -c cohort -n __cohort_begins -l help -d 'List the commands'
complete -c cohort -n __cohort_begins -l version -d 'Print the version'
)";
  for (const Command& command : commands) {
    text += fmt::format("complete -c cohort -n __cohort_begins -a {} -d {}\n",
                        command.name,
                        ForFish(command.summary));
  }
  for (const Command& command : commands) {
    for (const Tier tier : {Tier::kCommon, Tier::kExpert}) {
      for (const auto& [name, option] : FlagsOf(command, tier)) {
        text += fmt::format("complete -c cohort -n '__cohort_does {}{}' -l {}",
                            command.name,
                            tier == Tier::kExpert ? "; and __cohort_asks" : "",
                            name.substr(2));
        if (option->value == Value::kText) text += " -rF";
        if (TakesUnknown(*option)) text += " -x";
        if (option->value == Value::kChoice) {
          text += fmt::format(" -xa '{}'", fmt::join(option->choices, " "));
        }
        text += fmt::format(" -d {}\n", ForFish(Brief(option->text)));
      }
    }
  }
  return text;
}

}  // namespace cohort
