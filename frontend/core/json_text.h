#pragma once

#include <cstddef>
#include <set>
#include <string>
#include <vector>

#include "frontend/core/error.h"

namespace cohort {

// What is looked at before a text is parsed, as nlohmann's SAX interface tells it: Error where an
// object has a key twice (the last value would count, and nobody would know of the first), where
// what is in it lies so deep that who walks through it may run out of stack, and where objects have
// so many keys that to find them takes minutes (nlohmann's ordered objects search one by one).
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
    if (steps_ > kMostSteps) ThrowError("objects have too many keys, as {}", Json(name).dump());
    if (!keys.insert(name).second) {
      ThrowError("key {} stands twice in one object: leave one", Json(name).dump());
    }
    return true;
  }
  // Json::parse says it better.
  bool parse_error(std::size_t, const std::string&, const typename Json::exception&) {
    return false;
  }

 private:
  bool Open() {
    constexpr std::size_t kMostDeep = 100;
    if (keys_.size() == kMostDeep) ThrowError("it is more than {} levels deep", kMostDeep);
    keys_.emplace_back();
    return true;
  }
  bool Close() {
    keys_.pop_back();
    return true;
  }

  std::vector<std::set<std::string>> keys_;  // of the objects that are open; of lists none
  std::size_t steps_ = 0;
};

// The text as `Json`, one of nlohmann's types (not included here: who has none need not have its
// headers). Throws its errors, and those of JsonScan.
template <typename Json>
Json ParseWithoutTwins(const std::string& text) {
  JsonScan<Json> scan;
  Json::sax_parse(text, &scan);
  return Json::parse(text);
}

}  // namespace cohort
