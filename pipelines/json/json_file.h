#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace cohort {

// Indented, whole or not at all.
void WriteJsonFile(const std::filesystem::path& path, const nlohmann::ordered_json& json);
// Throws Error naming the path on a file that is missing, is no JSON or has more than 64 MiB. Others than
// our own, which are written again, the caller adds to the InputRecord.
nlohmann::ordered_json ReadJsonFile(const std::filesystem::path& path);
// Reads one of which `use` takes what should be there: what is missing, or of another type, is an
// Error naming the path.
void UseJsonFile(const std::filesystem::path& path,
                 const std::function<void(const nlohmann::ordered_json&)>& use);

// The count, 0 or more, that stands under `key`; another number throws what UseJsonFile makes an
// Error of, as a key that is missing does (get() would take -1 and 1e300, too).
std::size_t CountAt(const nlohmann::ordered_json& json, const char* key);

// One line of JSON. Bytes that are no UTF-8, as names of files may have, are replaced: JSON cannot
// hold them.
std::string JsonLine(const nlohmann::ordered_json& json);

}  // namespace cohort
