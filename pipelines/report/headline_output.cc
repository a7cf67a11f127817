#include "pipelines/report/headline_output.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "pipelines/console/table.h"

namespace cohort {
namespace {

using Json = nlohmann::ordered_json;
using TextRows = std::vector<std::vector<std::string>>;

// A metric's name in results.csv, and the heading of its column.
struct MetricColumn {
  const char* metric;
  const char* heading;
};
constexpr MetricColumn kColumns[] = {
    {kCameraErrorMetric, "cameras"}, {kPointErrorMetric, "points"}, {kTrackLengthMetric, "length"}};

constexpr ChoiceNames<RivalRole, 3> kRoleNames{{{"contender", RivalRole::kContender},
                                                {"bound", RivalRole::kBound},
                                                {"other", RivalRole::kOther}}};

// Three digits.
std::string Times(double ratio) {
  return fmt::format("{:.{}f}", ratio, ratio < 9.995 ? 2 : ratio < 99.95 ? 1 : 0);
}

std::string RatioText(const HeadlineRatio* ratio, std::size_t clips) {
  if (ratio == nullptr) return "-";
  std::string text = Times(ratio->value);
  if (ratio->least != ratio->largest) {
    text += fmt::format(" ({}..{})", Times(ratio->least), Times(ratio->largest));
  }
  if (ratio->clips < clips) text += fmt::format(" of {}", ratio->clips);
  return text;
}

// The number of clips of each, if a rival did not run on all of them.
std::string ClipsText(const HeadlineRuns& cohort, const HeadlineRuns& rival) {
  if (cohort.clips == rival.clips) return fmt::format("{}", cohort.clips);
  return fmt::format("{}/{}", cohort.clips, rival.clips);
}

void AppendFigures(const Headline& headline,
                   const HeadlineRuns& cohort,
                   const HeadlineRuns& rival,
                   std::vector<std::string>& line) {
  for (const MetricColumn& column : kColumns) {
    line.push_back(RatioText(
        headline.Ratio(rival.level, rival.backend, column.metric, rival.tracker), cohort.clips));
  }
  line.push_back(
      fmt::format("{:.0f}/{:.0f} %", 100.0 * cohort.registered, 100.0 * rival.registered));
  line.push_back(fmt::format("{}/{} of {}", cohort.failed, rival.failed, ClipsText(cohort, rival)));
}

TextRows HeadedTable(std::vector<std::string> heading) {
  for (const MetricColumn& column : kColumns) heading.push_back(column.heading);
  heading.insert(heading.end(), {"registered", "failed"});
  return {heading};
}

std::string Titled(const std::string& title, const TextRows& table, std::size_t left_columns) {
  if (table.size() == 1) return "";
  return fmt::format("{}\n{}", title, AlignedTable(WithoutEmptyColumns(table), left_columns));
}

Json RatioRow(const HeadlineRow& row) {
  return {{"level", row.level},
          {"backend", row.backend},
          {"metric", row.metric},
          {"rival", row.rival},
          {"ratio", row.ratio.value},
          {"least", row.ratio.least},
          {"largest", row.ratio.largest},
          {"clips", row.ratio.clips}};
}

Json RunsRow(const HeadlineRuns& runs) {
  return {{"level", runs.level},
          {"backend", runs.backend},
          {"tracker", runs.tracker},
          {"clips", runs.clips},
          {"failed", runs.failed},
          {"registered", runs.registered}};
}

Json LossRow(const Loss& loss) {
  return {{"sequence", loss.sequence},
          {"level", loss.level},
          {"backend", loss.backend},
          {"metric", loss.metric},
          {"rival", loss.rival},
          {"cohort", loss.cohort ? Json(*loss.cohort) : Json(nullptr)},
          {"best", loss.best}};
}

}  // namespace

std::string HeadlineTables(const Headline& headline) {
  const std::string& first = StandingRivals().front().name;
  TextRows beside_first = HeadedTable({"level", "backend"});
  TextRows beside_others = HeadedTable({"level", "backend", "rival"});
  bool has_bound = false;
  for (const HeadlineRuns& runs : headline.runs) {
    const HeadlineRuns* const own = headline.Runs(runs.level, runs.backend, headline.cohort);
    if (&runs == own) continue;
    std::vector<std::string> line{runs.level, runs.backend};
    if (runs.tracker != first) line.push_back(runs.tracker);
    AppendFigures(headline, *own, runs, line);
    (runs.tracker == first ? beside_first : beside_others).push_back(std::move(line));
  }
  for (const Rival& rival : headline.rivals) has_bound |= rival.role == RivalRole::kBound;
  std::string text =
      Titled(fmt::format("How many times better {} is than the best {}", headline.cohort, first),
             beside_first,
             2);
  const std::string others =
      Titled(fmt::format("How many times better {} is than each rival{}",
                         headline.cohort,
                         has_bound ? " (than the ceiling, how many times worse)" : ""),
             beside_others,
             3);
  return text + (text.empty() || others.empty() ? "" : "\n") + others;
}

Json HeadlineToJson(const Headline& headline) {
  Json json{{"cohort", headline.cohort},
            {"main_rival", StandingRivals().front().name},
            {"rivals", Json::array()},
            {"rows", Json::array()},
            {"runs", Json::array()},
            {"losses", Json::array()},
            {"contests", headline.contests}};
  for (const Rival& rival : headline.rivals) {
    json["rivals"].push_back({{"name", rival.name}, {"role", NameOf(kRoleNames, rival.role)}});
  }
  for (const HeadlineRow& row : headline.rows) json["rows"].push_back(RatioRow(row));
  for (const HeadlineRuns& runs : headline.runs) json["runs"].push_back(RunsRow(runs));
  for (const Loss& loss : headline.losses) json["losses"].push_back(LossRow(loss));
  return json;
}

}  // namespace cohort
