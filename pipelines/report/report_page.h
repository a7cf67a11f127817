#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string_view>

namespace cohort {

// Pages without their data, which replaces kReportDataMark: page/, bundled at build time. For
// `compare`, and for one clip.
extern const std::string_view kReportPage;
extern const std::string_view kClipPage;
inline constexpr std::string_view kReportDataMark = "@@COHORT_DATA@@";

// A page with its data; nothing in the data can become active content. Whole or not at all.
void WritePage(const std::filesystem::path& path,
               std::string_view page,
               const nlohmann::ordered_json& data);

}  // namespace cohort
