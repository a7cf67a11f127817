#include "pipelines/json/json_file.h"

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>

#include "frontend/core/error.h"
#include "frontend/core/json_text.h"
#include "frontend/storage/input_file.h"
#include "frontend/storage/input_record.h"
#include "frontend/storage/output.h"

namespace cohort {

using Json = nlohmann::ordered_json;

void WriteJsonFile(const std::filesystem::path& path, const Json& json) {
  OutputFile out(path);
  WriteBytes(out.partial(), json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  out.Commit();
}

Json ReadJsonFile(const std::filesystem::path& path) {
  constexpr std::uint64_t kMaxBytes = std::uint64_t{1} << 26;  // about 30 times as many in memory
  const OwnFile own(path);  // nearly all are ours and may be rewritten
  const std::string text = ReadBytes(path, kMaxBytes);
  try {
    return ParseWithoutTwins<Json>(text);
  } catch (const Error& e) {
    ThrowError("{}: {}", path.string(), e.what());
  } catch (const nlohmann::json::parse_error& e) {
    ThrowError("{}: is not valid JSON (byte {})", path.string(), e.byte);
  } catch (const nlohmann::json::exception& e) {  // a number out of range
    ThrowError("{}: is not valid JSON: {}", path.string(), e.what());
  }
}

std::size_t CountAt(const Json& json, const char* key) {
  return json.at(key).get_ref<const Json::number_unsigned_t&>();
}

void UseJsonFile(const std::filesystem::path& path, const std::function<void(const Json&)>& use) {
  const Json json = ReadJsonFile(path);
  try {
    use(json);
  } catch (const Json::exception& e) {
    ThrowError("{}: does not have the form that cohort writes: {}", path.string(), e.what());
  }
}

std::string JsonLine(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace cohort
