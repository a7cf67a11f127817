#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>

namespace cohort {

// Indented, whole or not at all.
void WriteJsonFile(const std::filesystem::path& path, const nlohmann::ordered_json& json);
// Throws Error naming the path on a file that is missing or is no JSON.
nlohmann::ordered_json ReadJsonFile(const std::filesystem::path& path);

}  // namespace cohort
