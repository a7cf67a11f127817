#pragma once

#include <set>
#include <string>
#include <vector>

#include "frontend/core/error.h"

namespace cohort {

// The text as `Json`, one of nlohmann's types (not included here: who has none need not have its
// headers). Throws its errors, and Error where an object has a key twice: the last value would count,
// and nobody would know of the first.
template <typename Json>
Json ParseWithoutTwins(const std::string& text) {
  std::vector<std::set<std::string>> keys;  // of the objects that are open
  using Event = typename Json::parse_event_t;
  return Json::parse(text, [&keys](int /*depth*/, Event event, Json& parsed) {
    if (event == Event::object_start) keys.emplace_back();
    if (event == Event::object_end) keys.pop_back();
    if (event == Event::key && !keys.back().insert(parsed.template get<std::string>()).second) {
      ThrowError("key {} stands twice in one object: leave one", parsed.dump());
    }
    return true;
  });
}

}  // namespace cohort
