#include <nlohmann/json.hpp>
#include <string>

#include "frontend/core/output.h"
#include "pipelines/json/json_file.h"
#include "pipelines/report/report_page.h"

namespace cohort {

void WritePage(const std::filesystem::path& path,
               std::string_view page,
               const nlohmann::ordered_json& data) {
  std::string text = JsonLine(data);
  // Nothing in the data may end the script element that it stands in.
  for (std::size_t at = text.find('<'); at != std::string::npos; at = text.find('<', at + 1)) {
    text.replace(at, 1, "\\u003c");
  }
  std::string written(page);
  written.replace(written.find(kReportDataMark), kReportDataMark.size(), text);
  OutputFile out(path);
  WriteBytes(out.partial(), written);
  out.Commit();
}

}  // namespace cohort
