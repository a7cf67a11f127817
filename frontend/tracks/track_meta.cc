#include "frontend/tracks/track_meta.h"

#include <fmt/format.h>

#include <array>
#include <sstream>
#include <string_view>
#include <utility>

namespace cohort {
namespace {

struct TextField {
  const char* key;
  std::string TrackMeta::*text;
};
constexpr std::array kTexts{
    TextField{"program", &TrackMeta::program},
    TextField{"tracker", &TrackMeta::tracker},
    TextField{"options", &TrackMeta::options},
    TextField{"second_pass_options", &TrackMeta::second_pass_options},
    TextField{"imported_from", &TrackMeta::imported_from},
    TextField{"refined_from", &TrackMeta::refined_from},
    TextField{"mask", &TrackMeta::mask},
    TextField{"mask_fingerprint", &TrackMeta::mask_fingerprint},
    TextField{"fixed_parts", &TrackMeta::fixed_parts},
    TextField{"fingerprint", &TrackMeta::fingerprint},
    TextField{"frames", &TrackMeta::frames},
    TextField{"layout", &TrackMeta::layout},
    TextField{"focal_source", &TrackMeta::focal_source},
    TextField{"warning", &TrackMeta::warning},
};
constexpr const char* kSecondPass = "second_pass";
constexpr const char* kDone = "done";
constexpr std::string_view kNone = "none: ";  // and why
constexpr const char* kCuts = "cuts";
constexpr const char* kRowOrder = "row_order";

std::string TextOf(const std::vector<FrameIndex>& cuts) {
  std::string text;
  for (const FrameIndex cut : cuts) {
    text += fmt::format("{}{}", text.empty() ? "" : " ", ToInt(cut));
  }
  return text;
}

std::vector<FrameIndex> CutsOfText(const std::string& text) {
  std::vector<FrameIndex> cuts;
  std::istringstream words(text);
  for (std::uint32_t frame = 0; words >> frame;) cuts.push_back(FrameIndex{frame});
  return cuts;
}

}  // namespace

std::map<std::string, std::string> RowsOf(const TrackMeta& meta) {
  std::map<std::string, std::string> rows = meta.other;
  for (const auto& [key, text] : kTexts) {
    if (!(meta.*text).empty()) rows[key] = meta.*text;
  }
  rows[kSecondPass] = meta.second_pass              ? kDone
                      : meta.no_second_pass.empty() ? "off"
                                                    : std::string(kNone) + meta.no_second_pass;
  if (!meta.cuts.empty()) rows[kCuts] = TextOf(meta.cuts);
  if (meta.row_order != RowOrder::kDown) rows[kRowOrder] = NameOf(kRowOrderNames, meta.row_order);
  return rows;
}

TrackMeta MetaOfRows(std::map<std::string, std::string> rows) {
  const auto take = [&rows](const char* key) {
    const auto row = rows.extract(key);
    return row.empty() ? std::string() : row.mapped();
  };
  TrackMeta meta;
  for (const auto& [key, text] : kTexts) meta.*text = take(key);
  const std::string second_pass = take(kSecondPass);
  meta.second_pass = second_pass == kDone;
  if (second_pass.starts_with(kNone)) meta.no_second_pass = second_pass.substr(kNone.size());
  meta.cuts = CutsOfText(take(kCuts));
  meta.row_order = ValueOf(kRowOrderNames, take(kRowOrder)).value_or(RowOrder::kDown);
  meta.other = std::move(rows);
  return meta;
}

}  // namespace cohort
