#pragma once

// Options are declared once. An options struct has in-class defaults and one static Visit that
// names every field, its range and its help. Visitors derive validation, command-line flags, --help
// and JSON from it:
//
//   struct KltOptions {
//     int window_px = 21;
//     template <typename Self, typename Visitor>
//     static void Visit(Self& o, Visitor& v) {
//       v.Number("window_px", o.window_px, 3, 101, "side of the square patch [px]");
//     }
//   };
//
// A visitor has: Number(name, value, min, max, help) for int, unsigned, double (min, max
// inclusive); Odd(name, value, min, max, help) for an int that must be odd; Flag(name, bool, help);
// Choice(name, enum, kNames, help); Text(name, std::string, help); List(name,
// std::vector<std::string>, help); Group(name, nested_options, help). kNames is a std::array of
// {text, enum value} pairs. Each takes a Tier as a last argument.

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "frontend/core/error.h"

namespace cohort {

// The audience of an option. --help shows the common ones, whose help is a full sentence that
// states the effect of a change; --help-all also shows the expert ones. A Group is common by
// default, and its fields' own tiers count; all fields of an expert group are expert.
enum class Tier { kCommon, kExpert };

template <typename Enum, std::size_t N>
using ChoiceNames = std::array<std::pair<std::string_view, Enum>, N>;

// The text of an enum value, from the table that its option uses.
template <typename Enum, std::size_t N>
constexpr std::string_view NameOf(const ChoiceNames<Enum, N>& names, Enum value) {
  for (const auto& [text, candidate] : names) {
    if (candidate == value) return text;
  }
  return "?";
}

// The reverse; nullopt for any other text.
template <typename Enum, std::size_t N>
constexpr std::optional<Enum> ValueOf(const ChoiceNames<Enum, N>& names, std::string_view text) {
  for (const auto& [candidate, value] : names) {
    if (candidate == text) return value;
  }
  return std::nullopt;
}

// Throws UsageError naming the first field that is out of range: field, value, bound.
class OptionValidator {
 public:
  template <typename T>
  void Number(
      std::string_view name, const T& value, T min, T max, std::string_view, Tier = Tier::kExpert) {
    if (!(value >= min && value <= max)) {
      ThrowUsageError("option {}{} = {} is out of range: give a value from {} to {}",
                      prefix_,
                      name,
                      value,
                      min,
                      max);
    }
  }
  void Odd(std::string_view name,
           const int& value,
           int min,
           int max,
           std::string_view help,
           Tier tier = Tier::kExpert) {
    if (value % 2 == 0) {
      ThrowUsageError("option {}{} = {} is even: give an odd number from {} to {}",
                      prefix_,
                      name,
                      value,
                      min,
                      max);
    }
    Number(name, value, min, max, help, tier);
  }
  void Flag(std::string_view, const bool&, std::string_view, Tier = Tier::kExpert) {}
  template <typename Enum, std::size_t N>
  void Choice(std::string_view,
              const Enum&,
              const ChoiceNames<Enum, N>&,
              std::string_view,
              Tier = Tier::kExpert) {}
  void Text(std::string_view, const std::string&, std::string_view, Tier = Tier::kExpert) {}
  void List(std::string_view,
            const std::vector<std::string>&,
            std::string_view,
            Tier = Tier::kExpert) {}
  template <typename Options>
  void Group(std::string_view name,
             const Options& options,
             std::string_view,
             Tier = Tier::kCommon) {
    OptionValidator nested;
    nested.prefix_ = prefix_ + std::string(name) + ".";
    Options::Visit(options, nested);
  }

 private:
  std::string prefix_;
};

template <typename Options>
void ValidateOptions(const Options& options) {
  OptionValidator validator;
  Options::Visit(options, validator);
}

}  // namespace cohort
