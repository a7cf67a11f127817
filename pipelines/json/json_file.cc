#include "pipelines/json/json_file.h"

#include <nlohmann/json.hpp>

#include "frontend/core/error.h"
#include "frontend/core/output.h"

namespace cohort {

void WriteJsonFile(const std::filesystem::path& path, const nlohmann::ordered_json& json) {
  OutputFile out(path);
  // Bytes that are no UTF-8, as names of files may have, are replaced: JSON cannot hold them.
  using Json = nlohmann::ordered_json;
  WriteBytes(out.partial(), json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
  out.Commit();
}

nlohmann::ordered_json ReadJsonFile(const std::filesystem::path& path) {
  try {
    return nlohmann::ordered_json::parse(ReadBytes(path));
  } catch (const nlohmann::json::parse_error& e) {
    ThrowError("{}: is no JSON (byte {})", path.string(), e.byte);
  } catch (const nlohmann::json::exception& e) {  // a number that fits none
    ThrowError("{}: is no JSON that is read: {}", path.string(), e.what());
  }
}

}  // namespace cohort
