#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <type_traits>
#include <variant>
#include <vector>

#include "frontend/core/options.h"

namespace cohort {

using OptionValue = std::variant<bool, std::int64_t, double, std::string, std::vector<std::string>>;

// One field of an options struct, independent of its type. `path` names it in JSON and on the
// command line: {"detector": {"max_features": 5}} and --detector.max-features 5 are
// detector.max_features.
struct OptionEntry {
  std::string path;
  std::string group;  // help of the group it is in; empty at the top
  std::string help;
  Tier tier = Tier::kExpert;
  std::string allowed;  // "3 to 101", "strong, weak"; empty: any text
  std::function<OptionValue()> get;
  // Throws UsageError that begins with `given_as` (the user's text, e.g. --features).
  std::function<void(const OptionValue& value, std::string_view given_as)> set;
  std::vector<std::string> choices = {};  // of an enum
};

// Visitor of frontend/core/options.h that lists the fields of `options` in order. The entries refer
// to `options`, which must outlive them.
class OptionLister {
 public:
  template <typename T>
  void Number(std::string_view name,
              T& field,
              T min,
              T max,
              std::string_view help,
              Tier tier = Tier::kExpert) {
    using Wide = std::conditional_t<std::is_floating_point_v<T>, double, std::int64_t>;
    const std::string allowed = fmt::format("{} to {}", min, max);
    entries_.push_back(
        {prefix_ + std::string(name),
         group_,
         std::string(help),
         tier,
         allowed,
         [&field] { return OptionValue(static_cast<Wide>(field)); },
         [&field, min, max, allowed](const OptionValue& value, std::string_view given_as) {
           const Wide wide = std::get<Wide>(value);
           if (!(wide >= static_cast<Wide>(min) && wide <= static_cast<Wide>(max))) {
             ThrowUsageError("{} {} is out of range: give {}", given_as, wide, allowed);
           }
           field = static_cast<T>(wide);
         }});
  }

  void Odd(std::string_view name,
           int& field,
           int min,
           int max,
           std::string_view help,
           Tier tier = Tier::kExpert) {
    Number(name, field, min, max, help, tier);
    OptionEntry& entry = entries_.back();
    entry.allowed = fmt::format("odd, {} to {}", min, max);
    entry.set = [min, max, set = std::move(entry.set)](const OptionValue& value,
                                                       std::string_view given_as) {
      const std::int64_t wide = std::get<std::int64_t>(value);
      if (wide % 2 == 0) {
        ThrowUsageError(
            "{} {} is even: give an odd number from {} to {}", given_as, wide, min, max);
      }
      set(value, given_as);
    };
  }

  void Flag(std::string_view name, bool& field, std::string_view help, Tier tier = Tier::kExpert) {
    Add(name, field, help, tier);
  }
  void Text(std::string_view name,
            std::string& field,
            std::string_view help,
            Tier tier = Tier::kExpert) {
    Add(name, field, help, tier);
  }
  void List(std::string_view name,
            std::vector<std::string>& field,
            std::string_view help,
            Tier tier = Tier::kExpert) {
    Add(name, field, help, tier);
  }

  template <typename Enum, std::size_t N>
  void Choice(std::string_view name,
              Enum& field,
              const ChoiceNames<Enum, N>& names,
              std::string_view help,
              Tier tier = Tier::kExpert) {
    std::vector<std::string> choices;
    for (const auto& [text, value] : names) choices.emplace_back(text);
    const std::string allowed = fmt::format("{}", fmt::join(choices, ", "));
    entries_.push_back(
        {prefix_ + std::string(name),
         group_,
         std::string(help),
         tier,
         allowed,
         [&field, &names] { return OptionValue(std::string(NameOf(names, field))); },
         [&field, &names, allowed](const OptionValue& value, std::string_view given_as) {
           for (const auto& [text, candidate] : names) {
             if (text == std::get<std::string>(value)) {
               field = candidate;
               return;
             }
           }
           ThrowUsageError("{} '{}' is unknown: give one of {}",
                           given_as,
                           std::get<std::string>(value),
                           allowed);
         },
         choices});
  }

  template <typename Options>
  void Group(std::string_view name,
             Options& options,
             std::string_view help,
             Tier tier = Tier::kCommon) {
    OptionLister nested;
    nested.prefix_ = prefix_ + std::string(name) + ".";
    nested.group_ = std::string(help);
    Options::Visit(options, nested);
    for (OptionEntry& entry : nested.entries_) {
      if (tier == Tier::kExpert) entry.tier = Tier::kExpert;
      entries_.push_back(std::move(entry));
    }
  }

  std::vector<OptionEntry> Take() { return std::move(entries_); }

 private:
  template <typename T>
  void Add(std::string_view name, T& field, std::string_view help, Tier tier) {
    entries_.push_back(
        {prefix_ + std::string(name),
         group_,
         std::string(help),
         tier,
         "",
         [&field] { return OptionValue(field); },
         [&field](const OptionValue& value, std::string_view) { field = std::get<T>(value); }});
  }

  std::string prefix_;
  std::string group_;
  std::vector<OptionEntry> entries_;
};

template <typename Options>
std::vector<OptionEntry> ListOptions(Options& options) {
  OptionLister lister;
  Options::Visit(options, lister);
  return lister.Take();
}

// Sets a field from the text of a command line ("true" and "false" for flags; a list is separated
// by commas). Throws UsageError that begins with `given_as`.
void SetFromText(const OptionEntry& entry, const std::string& text, std::string_view given_as);
std::string ToText(const OptionValue& value);

nlohmann::ordered_json OptionsToJson(const std::vector<OptionEntry>& entries);
template <typename Options>
auto ToJson(Options options) {
  return OptionsToJson(ListOptions(options));
}

// Paths of the fields that differ from a default Options, in their order.
template <typename Options>
std::vector<std::string> ChangedOptions(Options options) {
  Options defaults;
  const std::vector<OptionEntry> now = ListOptions(options);
  const std::vector<OptionEntry> before = ListOptions(defaults);
  std::vector<std::string> changed;
  for (std::size_t i = 0; i < now.size(); ++i) {
    if (now[i].get() != before[i].get()) changed.push_back(now[i].path);
  }
  return changed;
}

// Sets the fields that `json` names and leaves the others unchanged. Throws UsageError naming an
// unknown key or a value of another type; `origin` is the file's name for the message.
void SetFromJson(const std::vector<OptionEntry>& entries,
                 const nlohmann::ordered_json& json,
                 std::string_view origin);

}  // namespace cohort
