#include "pipelines/console/manual.h"

#include <algorithm>
#include <cctype>
#include <string_view>

#include "pipelines/sfm/version.h"

namespace cohort {
namespace {

// Text for roff: characters with a special meaning, or that roff would replace typographically, are
// escaped. A line that begins with such an escape is not a request.
std::string Escaped(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '\\':
        escaped += "\\e";
        break;
      case '-':
        escaped += "\\-";
        break;
      case '\'':
        escaped += "\\(aq";
        break;
      case '`':
        escaped += "\\(ga";
        break;
      case '^':
        escaped += "\\(ha";
        break;
      case '~':
        escaped += "\\(ti";
        break;
      case '.':
        escaped += escaped.empty() ? "\\&." : ".";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

std::string Upper(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), [](unsigned char c) {
    return static_cast<char>(std::toupper(c));
  });
  return text;
}

std::string Bold(std::string_view text) { return "\\fB" + Escaped(text) + "\\fR"; }

// Without justification and hyphenation, which would break the names of options.
std::string Head(const std::string& page, const std::string& summary) {
  return fmt::format(
      ".\\\" Made by write_manual from the declarations that --help shows.\n"
      ".TH \"{}\" \"1\" \"\" \"cohort {}\" \"cohort\"\n"
      ".nh\n"
      ".ad l\n"
      ".SH NAME\n"
      "{} \\- {}\n"
      ".SH SYNOPSIS\n",
      Escaped(Upper(page)),
      kVersion,
      Escaped(page),
      Escaped(summary));
}

std::string Item(const OptionHelp& option) {
  if (option.IsPositional()) {
    return fmt::format(".TP\n\\fI{}\\fR\n{}\n", Escaped(option.left), Escaped(option.text));
  }
  std::string names = Bold(option.left);
  if (option.value != OptionHelp::Value::kNone) names += " \\fIvalue\\fR";
  return fmt::format(".TP\n{}\n{}\n", names, Escaped(option.text));
}

std::string Items(const std::vector<OptionHelp>& options, Tier tier) {
  std::string text;
  std::string group;
  for (const OptionHelp& option : options) {
    if (option.tier != tier) continue;
    if (tier == Tier::kExpert && option.group != group) {
      group = option.group;
      text += fmt::format(".SS \"{}\"\n", Escaped(group));
    }
    text += Item(option);
  }
  return text;
}

constexpr std::string_view kExitStatus =
    ".SH EXIT STATUS\n"
    "0: done. 1: failed, with one line that begins with \\fBcohort: error:\\fR. 2: wrong usage.\n";

}  // namespace

std::string ManualOfProgram(const std::vector<Command>& commands) {
  std::string text =
      Head("cohort", "joint feature tracking for structure from motion in dark, noisy video");
  text +=
      "\\fBcohort\\fR \\fIcommand\\fR ...\n"
      ".br\n"
      "\\fBcohort\\fR \\fIcommand\\fR \\fB\\-\\-help\\fR|\\fB\\-\\-help\\-all\\fR\n"
      ".br\n"
      "\\fBcohort \\-\\-version\\fR\n"
      ".SH DESCRIPTION\n"
      "Tracks feature points jointly through dark, noisy, shaky video, and reconstructs cameras "
      "and points from the tracks, by itself or with COLMAP.\n"
      ".SH COMMANDS\n"
      "Each has a page of its own, such as \\fBcohort\\-track\\fR(1).\n";
  for (const Command& command : commands) {
    text += fmt::format(".TP\n{} {}\n{}.\n",
                        Bold("cohort " + command.name),
                        Escaped(command.usage),
                        Escaped(command.summary));
  }
  text += kExitStatus;
  text += ".SH SEE ALSO\n";
  for (const Command& command : commands) {
    text += fmt::format("{}(1),\n", Bold("cohort-" + command.name));
  }
  return text + "\\fBcolmap\\fR(1)\n";
}

std::string ManualOfCommand(const Command& command) {
  std::string text = Head("cohort-" + command.name, command.summary);
  text += fmt::format("{} {}\n.SH OPTIONS\n{}",
                      Bold("cohort " + command.name),
                      Escaped(command.usage),
                      Items(command.options, Tier::kCommon));
  if (const std::string expert = Items(command.options, Tier::kExpert); !expert.empty()) {
    text += ".SH EXPERT OPTIONS\n" + expert;
  }
  text += kExitStatus;
  return text + ".SH SEE ALSO\n\\fBcohort\\fR(1)\n";
}

}  // namespace cohort
