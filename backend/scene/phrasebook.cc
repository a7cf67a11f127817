#include "backend/scene/phrasebook.h"

#include <fmt/format.h>

#include <cmath>
#include <utility>

namespace cohort {
namespace {

constexpr const char* kTracksDrift =
    "if the camera moved, the tracks do not show it: they drift, or lie on moving objects";

std::string DescribeDepths(double uncertainty) {
  if (!std::isfinite(uncertainty)) return "depths are unknown";
  return fmt::format("depths are known only to within {:.0f} %", 100.0 * uncertainty);
}

std::string DescribeUnexplained(double share) {
  if (!std::isfinite(share)) return "none of the parallax is explained";
  return fmt::format("{:.0f} % of the parallax is unexplained", 100.0 * share);
}

}  // namespace

Doubt FewFramesDoubt(std::size_t registered, std::size_t frames) {
  return {
      DoubtCode::kFewFrames,
      fmt::format("only {} of {} frames have a camera: film the others more slowly, in more "
                  "light, or with more overlap",
                  registered,
                  frames),
      {{"registered", static_cast<double>(registered)}, {"frames", static_cast<double>(frames)}}};
}

Doubt PartsDoubt(std::size_t parts, bool is_largest) {
  return {DoubtCode::kParts,
          fmt::format("the clip breaks into {} parts, of which this is the largest{}: film the "
                      "places between them more slowly",
                      parts,
                      is_largest ? "" : " usable part"),
          {{"parts", static_cast<double>(parts)}}};
}

Doubt OnlyTurnsDoubt(bool camera_known) {
  return {DoubtCode::kOnlyTurns,
          fmt::format("a rotating camera with a lens other than {} explains all motion equally "
                      "well, in which case there is no depth: walk sideways while you film, {}",
                      camera_known ? "the given one" : "the estimated one",
                      camera_known ? "check --camera" : "give --camera if you know it")};
}

Doubt WeakDepthDoubt(double depth_uncertainty) {
  return {DoubtCode::kWeakDepth,
          DescribeDepths(depth_uncertainty) + ": move the camera further sideways",
          {{"depth_uncertainty", depth_uncertainty}}};
}

Doubt UnexplainedParallaxDoubt(double unexplained_parallax) {
  return {DoubtCode::kUnexplainedParallax,
          DescribeUnexplained(unexplained_parallax) +
              ": the tracks drift or lie on moving objects, or the camera hardly moved; film along "
              "a longer path, in more light",
          {{"unexplained_parallax", unexplained_parallax}}};
}

Doubt WorthlessDoubt(const MapperEnd& end) { return {DoubtCode::kWorthless, TerminationLine(end)}; }

Doubt CameraContradictedDoubt(const Camera& better, const Camera& given) {
  return {DoubtCode::kCameraContradicted,
          fmt::format("the tracks contradict the given camera: they imply fx {:.1f} instead of "
                      "{:.1f} px and k1 {:.3f}, k2 {:.3f} instead of {:.3f}, {:.3f}: give another "
                      "--camera, or none",
                      better.fx,
                      given.fx,
                      better.k1,
                      better.k2,
                      given.k1,
                      given.k2),
          {{"fx", better.fx},
           {"k1", better.k1},
           {"k2", better.k2},
           {"given_fx", given.fx},
           {"given_k1", given.k1},
           {"given_k2", given.k2}}};
}

Doubt ExcessNoiseDoubt(double noise_left_px, double noise_px) {
  return {DoubtCode::kExcessNoise,
          fmt::format("the residual noise of the model is {:.2f} px, but that of the tracks is "
                      "{:.2f} px: the given camera is wrong, or the tracks drift or lie on moving "
                      "objects; check --camera",
                      noise_left_px,
                      noise_px),
          {{"noise_left_px", noise_left_px}, {"noise_px", noise_px}}};
}

Doubt TwoCamerasDoubt(const Camera& camera, const Camera& rival) {
  return {DoubtCode::kTwoCameras,
          fmt::format("two cameras explain the tracks equally well, with focal lengths of {:.0f} "
                      "and {:.0f} px: turn the camera while it moves, or give --camera",
                      camera.fx,
                      rival.fx),
          {{"focal_px", camera.fx}, {"rival_focal_px", rival.fx}}};
}

Doubt FoundZoomDoubt(double zoom) {
  return {DoubtCode::kFocalChanges,
          fmt::format("the focal length changes during the clip by a factor of {:.2f}; every frame "
                      "has its own focal length, but a zoom looks much like forward motion: the "
                      "cameras may be off along the line of sight",
                      zoom),
          {{"zoom", zoom}}};
}

Doubt UnmodelledZoomDoubt(double zoom, double gain) {
  return {DoubtCode::kFocalChanges,
          fmt::format("the focal length changes during the clip by a factor of about {:.2f}: the "
                      "lens zooms or refocuses, but the model has one focal length for all frames; "
                      "give the frames before or after the change by --frames",
                      zoom),
          {{"zoom", zoom}, {"gain", gain}}};
}

Doubt CenterMovesDoubt(double shift_px, double gain, bool may_zoom) {
  return {DoubtCode::kCenterMoves,
          fmt::format("the picture is shifted from frame to frame, by up to {:.0f} px{}, which no "
                      "motion of the camera explains: a stabiliser{} causes this; film without it, "
                      "or give the original clip",
                      shift_px,
                      may_zoom ? ", or its focal length changes" : "",
                      may_zoom ? " or a zoom" : ""),
          {{"shift_px", shift_px}, {"gain", gain}}};
}

Doubt FocalUncertainDoubt(double focal_sigma) {
  return {DoubtCode::kFocalUncertain,
          fmt::format("the focal length is known only to within {:.0f} %, and so are the depths: "
                      "turn the camera while it moves, or give --camera",
                      100.0 * focal_sigma),
          {{"focal_sigma", focal_sigma}}};
}

Doubt CamerasUncertainDoubt(double expected_error) {
  return {DoubtCode::kCamerasUncertain,
          fmt::format("the cameras are expected to be off by {:.1f} % of the extent of their path, "
                      "perhaps by twice as much: film along a longer path, in steady light, with "
                      "more texture in the picture",
                      100.0 * expected_error),
          {{"expected_error", expected_error}}};
}

Doubt PointsOnALineDoubt(double spread_across_line) {
  return {DoubtCode::kPointsOnALine,
          "the points lie along a line, about which the cameras may rotate freely: also film "
          "textured surfaces beside it",
          {{"spread_across_line", spread_across_line}}};
}

Doubt FewPointsDoubt(const std::vector<FrameIndex>& frames, std::size_t points, double median) {
  const bool one = frames.size() == 1;
  return {DoubtCode::kFewPoints,
          fmt::format("{} constrained by few points ({}{}, compared with a median of {:.0f}), "
                      "which may drift together: film textured surfaces there, or leave {} out by "
                      "--frames",
                      one ? fmt::format("frame {} is", ToInt(frames.front()))
                          : fmt::format("{} frames, the first of them {} and the last {}, are",
                                        frames.size(),
                                        ToInt(frames.front()),
                                        ToInt(frames.back())),
                      one ? "" : "at least ",
                      points,
                      median,
                      one ? "it" : "these frames"),
          {{"frames", static_cast<double>(frames.size())},
           {"points", static_cast<double>(points)},
           {"median_points", median}}};
}

Doubt ThingsMoveDoubt(double moving_share) {
  return {DoubtCode::kThingsMove,
          fmt::format("{:.0f} % of the observations are on independently moving objects, and the "
                      "model may show such an object instead of the scene: mask what the model "
                      "should not show with --mask",
                      100.0 * moving_share),
          {{"moving_share", moving_share}}};
}

Doubt NoModelByCeresDoubt(const std::string& termination) {
  return {DoubtCode::kNoModelByCeres, "Ceres finds no model of these tracks: " + termination};
}

Doubt NotJudgedDoubt() {
  return {DoubtCode::kNotJudged,
          "this model has not been judged, since Ceres did not run: leave out --no-ceres-start or "
          "--no-global-shutter"};
}

Doubt AsDoubtByCeres(Doubt doubt) {
  doubt.sentence = "according to the model of Ceres from the same tracks: " + doubt.sentence;
  return doubt;
}

MapperEnd TooFewFramesEnd(std::size_t frames, std::size_t least) {
  return {MapperTermination::kTooFewTracks,
          fmt::format("the clip has {} frame{}, at least {} are needed",
                      frames,
                      frames == 1 ? "" : "s",
                      least)};
}

MapperEnd TracksTooShortEnd(std::size_t tracks, int least_length) {
  return {MapperTermination::kTooFewTracks,
          fmt::format("none of {} tracks is observed in {} frames", tracks, least_length)};
}

MapperEnd NothingSharedEnd(int least_common) {
  return {MapperTermination::kTooFewTracks,
          fmt::format("no two keyframes that were tried share {} tracks", least_common)};
}

MapperEnd NoGeometryEnd(int least_inliers) {
  return {MapperTermination::kNoStart,
          fmt::format("no two frames share {} tracks that agree on a geometry", least_inliers)};
}

MapperEnd StillPictureEnd(double motion_px, double noise_px) {
  return {MapperTermination::kStaticCamera,
          fmt::format("the picture moves by {:.1f} px at most, and the noise of the tracks is "
                      "{:.2f} px",
                      motion_px,
                      noise_px)};
}

MapperEnd OnlyTurnsEnd() {
  return {MapperTermination::kPureRotation,
          "a rotation about the camera's centre explains all motion, so there is no depth"};
}

MapperEnd StillWithDriftEnd() { return {MapperTermination::kStaticCamera, kTracksDrift}; }

MapperEnd OnlyTurnsWithDriftEnd() {
  return {
      MapperTermination::kPureRotation,
      std::string("a rotation about the camera's centre explains most motion; ") + kTracksDrift};
}

MapperEnd NoStartEnd(std::size_t windows_tried) {
  return {MapperTermination::kNoStart,
          fmt::format("there is parallax, but none of {} windows gave a consistent model",
                      windows_tried)};
}

MapperEnd WeakDepthEnd(double depth_uncertainty) {
  return {MapperTermination::kWeakDepth,
          DescribeDepths(depth_uncertainty) + ": too little parallax for the noise"};
}

MapperEnd NotRigidEnd() {
  return {MapperTermination::kNotRigid,
          "no rigid scene explains the motion of the tracks beyond a rotation of the camera: they "
          "drift, or most of them lie on moving objects"};
}

std::string TerminationLine(const MapperEnd& end) {
  const std::string line(NameOf(kMapperTerminationNames, end.termination));
  return end.detail.empty() ? line : line + ": " + end.detail;
}

std::optional<MapperTermination> EndingOf(std::string_view line) {
  for (const auto& [name, ending] : kMapperTerminationNames) {
    if (line.starts_with(name)) return ending;
  }
  return std::nullopt;
}

std::string FramesText(FrameIndex first, FrameIndex last) {
  return first == last ? fmt::format("frame {}", ToInt(first))
                       : fmt::format("frames {} to {}", ToInt(first), ToInt(last));
}

std::string DescribeAside(const Aside& aside) {
  std::string frames = FramesText(aside.first, aside.last);
  const char* const show = aside.first == aside.last ? "shows" : "show";
  switch (aside.kind) {
    case AsideKind::kBlank:
      return fmt::format("{} {} nothing: black, or without any texture", frames, show);
    case AsideKind::kCard:
      return fmt::format("{} {} a still picture, such as a title card", frames, show);
    case AsideKind::kOtherScene:
      return fmt::format("{} {} another scene", frames, show);
  }
  return frames;
}

}  // namespace cohort
