#pragma once

#include <cstddef>
#include <set>
#include <string>
#include <vector>

#include "frontend/core/error.h"

namespace cohort {

// Checks a text before it is parsed, by nlohmann's SAX interface. Throws Error if an object has a
// key twice (the last value would silently replace the first), if the nesting is so deep that a
// recursive reader may overflow the stack, or if objects have so many keys that finding them takes
// minutes (nlohmann's ordered objects search linearly).
template <typename Json>
class JsonScan {
 public:
  bool null() { return true; }
  bool boolean(bool) { return true; }
  bool number_integer(typename Json::number_integer_t) { return true; }
  bool number_unsigned(typename Json::number_unsigned_t) { return true; }
  bool number_float(typename Json::number_float_t, const typename Json::string_t&) { return true; }
  bool string(typename Json::string_t&) { return true; }
  bool binary(typename Json::binary_t&) { return true; }
  bool start_object(std::size_t) { return Open(); }
  bool end_object() { return Close(); }
  bool start_array(std::size_t) { return Open(); }
  bool end_array() { return Close(); }
  bool key(typename Json::string_t& name) {
    constexpr std::size_t kMostSteps = 1'000'000'000;
    constexpr std::size_t kStepBytes = 16;  // keys may differ in their last letter alone
    std::set<std::string>& keys = keys_.back();
    steps_ += keys.size() * (1 + name.size() / kStepBytes);
    if (steps_ > kMostSteps)
      ThrowError("objects have too many keys, such as {}", Json(name).dump());
    if (!keys.insert(name).second) {
      ThrowError("key {} occurs twice in one object: keep one", Json(name).dump());
    }
    return true;
  }
  // Json::parse gives a better message.
  bool parse_error(std::size_t, const std::string&, const typename Json::exception&) {
    return false;
  }

 private:
  bool Open() {
    constexpr std::size_t kMostDeep = 100;
    if (keys_.size() == kMostDeep) ThrowError("it is nested more than {} levels deep", kMostDeep);
    keys_.emplace_back();
    return true;
  }
  bool Close() {
    keys_.pop_back();
    return true;
  }

  std::vector<std::set<std::string>> keys_;  // of the open objects; empty sets for lists
  std::size_t steps_ = 0;
};

// Parses the text as `Json`, one of nlohmann's types (not included here, so that this header does
// not require it). Throws its errors, and those of JsonScan.
template <typename Json>
Json ParseWithoutTwins(const std::string& text) {
  JsonScan<Json> scan;
  Json::sax_parse(text, &scan);
  return Json::parse(text);
}

}  // namespace cohort
