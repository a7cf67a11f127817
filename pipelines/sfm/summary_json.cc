#include "pipelines/sfm/summary_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <string>

#include "backend/judge/judgement.h"
#include "pipelines/json/option_list.h"

namespace cohort {
namespace {

using Json = nlohmann::ordered_json;

Json CameraToJson(const Camera& c) {
  return {{"model", NameOf(kCameraModelNames, c.model)},
          {"fx", c.fx},
          {"fy", c.fy},
          {"cx", c.cx},
          {"cy", c.cy},
          {"k1", c.k1},
          {"k2", c.k2},
          {"p1", c.p1},
          {"p2", c.p2},
          {"k3", c.k3},
          {"k4", c.k4},
          {"k5", c.k5},
          {"k6", c.k6}};
}

Json FindingsToJson(const CeresFindings& findings, const Reconstruction& reconstruction) {
  Json json{{"tracks_without_point", findings.without_point.size()}};
  if (!reconstruction.cam_from_world.empty()) {
    json["depth_uncertainty"] = findings.depth_uncertainty;
    json["unexplained_parallax"] = findings.unexplained_parallax;
    json["noise"] = findings.noise;
    json["camera"] = CameraToJson(reconstruction.camera);
    if (findings.focal_sigma) {
      json["camera"]["sigma"] = {{"fx", *findings.focal_sigma * reconstruction.camera.fx}};
    }
    if (findings.expected_error) json["expected_error"] = *findings.expected_error;
  }
  if (findings.better_camera) json["better_camera"] = CameraToJson(*findings.better_camera);
  for (const Reconstruction& part : findings.other_parts) {
    json["other_parts"].push_back({{"first_frame", ToInt(part.cam_from_world.begin()->first)},
                                   {"last_frame", ToInt(part.cam_from_world.rbegin()->first)},
                                   {"registered", part.cam_from_world.size()},
                                   {"points", part.points.size()}});
  }
  return json;
}

Json DoubtToJson(const Doubt& doubt) {
  Json figures = Json::object();
  for (const auto& [name, value] : doubt.figures) {
    if (std::isfinite(value)) figures[name] = value;
  }
  return {{"code", NameOf(kDoubtCodeNames, doubt.code)},
          {"sentence", doubt.sentence},
          {"figures", std::move(figures)}};
}

Doubt DoubtFromJson(const Json& json) {
  Doubt doubt{
      ValueOf(kDoubtCodeNames, json.at("code").get<std::string>()).value_or(DoubtCode::kOther),
      json.at("sentence").get<std::string>()};
  for (const auto& [name, value] : json.at("figures").get_ref<const Json::object_t&>()) {
    doubt.figures.emplace_back(name, value.get<double>());
  }
  return doubt;
}

Json ShutterToJson(const Reconstruction& reconstruction) {
  Json json{{"readout", reconstruction.readout},
            {"row_order", NameOf(kRowOrderNames, reconstruction.camera.row_order)}};
  for (const auto& [frame, original] : reconstruction.repeats) {
    json["repeats"].push_back({ToInt(frame.index), ToInt(original)});
  }
  if (reconstruction.readout == 0.0) return json;
  for (const auto& [frame, time] : reconstruction.frame_times) {
    json["frame_times"].push_back({ToInt(frame), time});
  }
  return json;
}

// Adds the shortest and the longest focal length if it changes.
void AddFocalLengths(const Reconstruction& reconstruction, Json& json) {
  if (reconstruction.focal_scale.empty()) return;
  const FocalLengths lengths = FocalLengthsOf(reconstruction);
  json["focal_lengths_px"] = {{"min", lengths.min_px}, {"max", lengths.max_px}};
}

}  // namespace

std::string RangeOf(const std::vector<FrameInfo>& frames) {
  if (frames.empty()) return "0:0";
  const std::uint32_t first = ToInt(frames.front().index);
  std::uint32_t stride = 0;  // the largest that includes all frames
  for (const FrameInfo& frame : frames) stride = std::gcd(stride, ToInt(frame.index) - first);
  stride = std::max(stride, 1U);
  return fmt::format("{}:{}:{}", first, ToInt(frames.back().index) + 1, stride);
}

Json DoubtsToJson(const std::vector<Doubt>& doubts) {
  Json json = Json::array();
  for (const Doubt& doubt : doubts) json.push_back(DoubtToJson(doubt));
  return json;
}

std::vector<Aside> AsidesOf(const Json& summary) {
  std::vector<Aside> asides;
  if (!summary.contains("asides")) return asides;
  for (const Json& aside : summary.at("asides")) {
    asides.push_back({FrameIndex{aside.at("first_frame").get<std::uint32_t>()},
                      FrameIndex{aside.at("last_frame").get<std::uint32_t>()},
                      ValueOf(kAsideKindNames, aside.at("shows").get<std::string>())
                          .value_or(AsideKind::kOtherScene)});
  }
  return asides;
}

std::vector<Doubt> DoubtsFromJson(const Json& json) {
  std::vector<Doubt> doubts;
  for (const Json& doubt : json.get_ref<const Json::array_t&>()) {
    doubts.push_back(DoubtFromJson(doubt));
  }
  return doubts;
}

nlohmann::ordered_json SummaryToJson(const ReconstructionSummary& summary,
                                     const std::vector<FrameInfo>& frames) {
  Json asides = Json::array();
  for (const Aside& aside : summary.asides) {
    asides.push_back({{"first_frame", ToInt(aside.first)},
                      {"last_frame", ToInt(aside.last)},
                      {"shows", NameOf(kAsideKindNames, aside.kind)}});
  }
  return {{"registered", summary.registered},
          {"frames", summary.frames},
          {"scene_frames", summary.SceneFrames()},
          {"asides", std::move(asides)},
          {"frame_range", RangeOf(frames)},
          {"failed", summary.Failed()},
          {"points", summary.points},
          {"observations", summary.observations},
          {"mean_track_length", summary.mean_track_length},
          {"mean_reprojection_px", summary.mean_reprojection_px},
          {"seconds", summary.seconds},
          {"termination", summary.termination}};
}

Json SummaryOfPart(const Reconstruction& part, const std::vector<FrameInfo>& frames) {
  std::vector<FrameInfo> within;
  for (const FrameInfo& frame : frames) {
    if (frame.index >= part.cam_from_world.begin()->first &&
        frame.index <= part.cam_from_world.rbegin()->first) {
      within.push_back(frame);
    }
  }
  ReconstructionSummary summary = Summarize(part, within.size() + part.repeats.size());
  summary.termination = "another part of the clip";
  Json json = SummaryToJson(summary, within);
  json.erase("seconds");  // they are those of all parts together
  json.update(ShutterToJson(part));
  json["camera"] = CameraToJson(part.camera);
  AddFocalLengths(part, json);
  return json;
}

Json SummaryToJson(const ReconstructResult& result,
                   const std::vector<FrameInfo>& frames,
                   const ReconstructOptions& options) {
  Json summary{{"backend", NameOf(kBackendNames, options.backend)}};
  summary.update(SummaryToJson(result.summary, frames));
  summary.update(ShutterToJson(result.reconstruction));
  AddFocalLengths(result.reconstruction, summary);
  summary["options"] = ToJson(options);
  summary["quality"] = NameOf(kModelQualityNames, result.summary.Quality());
  summary["reasons"] = DoubtsToJson(result.summary.reasons);
  if (result.ceres) summary.update(FindingsToJson(*result.ceres, result.reconstruction));
  return summary;
}

}  // namespace cohort
