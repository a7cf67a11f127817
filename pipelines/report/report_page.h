#pragma once

#include <string_view>

namespace cohort {

// The page without its data, which goes where kReportDataMark stands: page/, bundled when the
// program is built.
extern const std::string_view kReportPage;
inline constexpr std::string_view kReportDataMark = "@@COHORT_DATA@@";

}  // namespace cohort
