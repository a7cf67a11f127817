#include "pipelines/json/option_list.h"

#include <algorithm>
#include <charconv>
#include <nlohmann/json.hpp>
#include <optional>

namespace cohort {
namespace {

using Json = nlohmann::ordered_json;

std::vector<std::string> SplitAtCommas(const std::string& text) {
  std::vector<std::string> parts;
  for (std::size_t begin = 0; begin <= text.size();) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    if (end > begin) parts.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

template <typename T>
T ParseNumber(const std::string& text, std::string_view given_as, const std::string& allowed) {
  T value{};
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc() || stop != end) {
    ThrowUsageError("{} '{}' is not a {}: give {}",
                    given_as,
                    text,
                    std::is_integral_v<T> ? "whole number" : "number",
                    allowed);
  }
  return value;
}

// `--check` gives true, `--check=off` the value after the equals sign.
bool ParseFlag(const std::string& text, std::string_view given_as) {
  for (const char* word : {"true", "on", "yes", "1"}) {
    if (text == word) return true;
  }
  for (const char* word : {"false", "off", "no", "0"}) {
    if (text == word) return false;
  }
  ThrowUsageError("{} '{}': give on or off", given_as, text);
}

// The value in the JSON if it has the type of `like`.
std::optional<OptionValue> FromJson(const Json& json, const OptionValue& like) {
  return std::visit(
      [&json](const auto& kind) -> std::optional<OptionValue> {
        using T = std::decay_t<decltype(kind)>;
        if constexpr (std::is_same_v<T, bool>) {
          if (!json.is_boolean()) return std::nullopt;
        } else if constexpr (std::is_same_v<T, std::int64_t>) {
          if (!json.is_number_integer()) return std::nullopt;
        } else if constexpr (std::is_same_v<T, double>) {
          if (!json.is_number()) return std::nullopt;
        } else if constexpr (std::is_same_v<T, std::string>) {
          if (!json.is_string()) return std::nullopt;
        } else {
          if (!json.is_array()) return std::nullopt;
          for (const Json& item : json) {
            if (!item.is_string()) return std::nullopt;
          }
        }
        return OptionValue(json.get<T>());
      },
      like);
}

std::string_view TypeName(const OptionValue& value) {
  static constexpr std::string_view kNames[] = {
      "true or false", "a whole number", "a number", "a text", "a list of texts"};
  return kNames[value.index()];
}

void SetObject(const std::vector<OptionEntry>& entries,
               const Json& object,
               const std::string& prefix,
               std::string_view origin) {
  for (const auto& [key, value] : object.items()) {
    const std::string path = prefix + key;
    const auto entry = std::find_if(
        entries.begin(), entries.end(), [&](const OptionEntry& e) { return e.path == path; });
    if (entry != entries.end()) {
      const auto typed = FromJson(value, entry->get());
      if (!typed) {
        ThrowUsageError("{}: key {} must be {}", origin, path, TypeName(entry->get()));
      }
      entry->set(*typed, fmt::format("{}: key {} =", origin, path));
      continue;
    }
    const bool is_group = std::any_of(entries.begin(), entries.end(), [&](const OptionEntry& e) {
      return e.path.starts_with(path + ".");
    });
    if (!is_group) {
      ThrowUsageError("{}: unknown key {}: --dump-config prints all keys", origin, path);
    }
    if (!value.is_object()) {
      ThrowUsageError("{}: key {} must be an object: --dump-config prints its keys", origin, path);
    }
    SetObject(entries, value, path + ".", origin);
  }
}

}  // namespace

void SetFromText(const OptionEntry& entry, const std::string& text, std::string_view given_as) {
  const OptionValue value = std::visit(
      [&](const auto& kind) -> OptionValue {
        using T = std::decay_t<decltype(kind)>;
        if constexpr (std::is_same_v<T, bool>) {
          return ParseFlag(text, given_as);
        } else if constexpr (std::is_arithmetic_v<T>) {
          return ParseNumber<T>(text, given_as, entry.allowed);
        } else if constexpr (std::is_same_v<T, std::string>) {
          return text;
        } else {
          return SplitAtCommas(text);
        }
      },
      entry.get());
  entry.set(value, given_as);
}

std::string ToText(const OptionValue& value) {
  return std::visit(
      [](const auto& v) -> std::string {
        using T = std::decay_t<decltype(v)>;
        if constexpr (std::is_same_v<T, bool>) {
          return v ? "on" : "off";
        } else if constexpr (std::is_same_v<T, std::vector<std::string>>) {
          return fmt::format("{}", fmt::join(v, ","));
        } else {
          return fmt::format("{}", v);
        }
      },
      value);
}

Json OptionsToJson(const std::vector<OptionEntry>& entries) {
  Json json = Json::object();
  for (const OptionEntry& entry : entries) {
    Json* object = &json;
    std::size_t begin = 0;
    for (std::size_t dot; (dot = entry.path.find('.', begin)) != std::string::npos;) {
      object = &(*object)[entry.path.substr(begin, dot - begin)];
      begin = dot + 1;
    }
    std::visit([&](const auto& value) { (*object)[entry.path.substr(begin)] = value; },
               entry.get());
  }
  return json;
}

void SetFromJson(const std::vector<OptionEntry>& entries,
                 const Json& json,
                 std::string_view origin) {
  if (!json.is_object()) {
    ThrowUsageError("{}: must hold one JSON object, as --dump-config prints it", origin);
  }
  SetObject(entries, json, "", origin);
}

}  // namespace cohort
