#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace cohort {

// Indented, whole or not at all.
void WriteJsonFile(const std::filesystem::path& path, const nlohmann::ordered_json& json);
// Throws Error naming the path if the file is missing, is not JSON or is larger than 64 MiB. The
// caller must add files that are not our own, and thus not rewritten, to the InputRecord.
nlohmann::ordered_json ReadJsonFile(const std::filesystem::path& path);
// Reads a file and passes it to `use`, which takes the expected entries: a missing entry, or one of
// another type, is an Error naming the path.
void UseJsonFile(const std::filesystem::path& path,
                 const std::function<void(const nlohmann::ordered_json&)>& use);

// The count, 0 or more, under `key`. Another number or a missing key throws an exception that
// UseJsonFile turns into an Error (get() would accept -1 and 1e300).
std::size_t CountAt(const nlohmann::ordered_json& json, const char* key);

// One line of JSON. Bytes that are not UTF-8, as in file names, are replaced, because JSON cannot
// represent them.
std::string JsonLine(const nlohmann::ordered_json& json);

}  // namespace cohort
