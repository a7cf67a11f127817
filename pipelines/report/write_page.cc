#include <nlohmann/json.hpp>
#include <string>

#include "frontend/storage/output.h"
#include "pipelines/json/json_file.h"
#include "pipelines/report/report_page.h"

namespace cohort {

void WritePage(const std::filesystem::path& path,
               std::string_view page,
               const nlohmann::ordered_json& data) {
  // Nothing in the data may end the script element that contains it.
  std::string text;
  for (const char c : JsonLine(data)) {
    if (c == '<') {
      text += "\\u003c";
    } else {
      text += c;
    }
  }
  std::string written(page);
  written.replace(written.find(kReportDataMark), kReportDataMark.size(), text);
  OutputFile out(path);
  WriteBytes(out.partial(), written);
  out.Commit();
}

}  // namespace cohort
