#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "backend/scene/focal_scale.h"
#include "backend/scene/frame_times.h"
#include "frontend/core/options.h"
#include "frontend/geometry/camera.h"
#include "frontend/geometry/rigid3.h"
#include "frontend/tracks/observation.h"
#include "frontend/tracks/track_set.h"

namespace cohort {

// The largest error of an observation that a model uses [px]; COLMAP's default.
inline constexpr double kMaxReprojectionPx = 4.0;

// An observation that a reconstruction uses: the point of `feature` was seen at xy in `frame`.
struct PointView {
  FrameIndex frame{};
  Eigen::Vector2d xy = Eigen::Vector2d::Zero();  // pixels, our convention
};

struct Point3D {
  Eigen::Vector3d in_world = Eigen::Vector3d::Zero();
  std::vector<PointView> views;  // ascending frames, those that bundle adjustment kept
  double mean_reprojection_px = 0.0;
};

// Cameras and points of a clip, up to a similarity of the world. All frames share one camera; only
// its focal length may change. A point has the id of its feature.
struct Reconstruction {
  Camera camera;
  // Zoom and autofocus: a frame's focal length divided by that of `camera` (CameraOf). A frame that
  // is not listed has 1.
  FocalScales focal_scale;
  // Rolling shutter: the share of the time between frames from the first row to the last (< 0: from
  // the bottom up; 0: a global one). A frame's pose is its middle row's (RowPoses).
  double readout = 0.0;
  std::map<FrameIndex, Rigid3> cam_from_world;  // registered frames only, no repeats
  std::map<FrameIndex, std::string> frame_names;
  std::map<FrameIndex, std::int64_t> timestamps_ns;
  FrameTimes frame_times;              // in the intervals that `readout` is a share of
  std::vector<RepeatedFrame> repeats;  // of registered frames, whose poses they share; ascending
  std::map<FeatureId, Point3D> points;
};

// The camera for projecting into a frame and unprojecting its positions.
Camera CameraOf(const Reconstruction& reconstruction, FrameIndex frame);

// The shortest and the longest fx of the registered frames [px].
struct FocalLengths {
  double min_px = 0.0;
  double max_px = 0.0;
};
FocalLengths FocalLengthsOf(const Reconstruction& reconstruction);

// Fills mean_reprojection_px of every point from cameras, points and views.
void UpdateReprojectionErrors(Reconstruction& reconstruction);
// Moves the views to the positions in `tracks`: the same views, as a shutter of that readout saw
// them.
void MoveViewsToTracks(const TrackSet& tracks, double readout, Reconstruction& reconstruction);

// The distances of each frame's views from the projections of their points [px]; the picture's
// width for points behind the camera.
std::map<FrameIndex, std::vector<double>> ReprojectionErrors(const Reconstruction& reconstruction);

// Median over views of the distance from the camera to the point; 0 without any. It is the unit of
// reports, because a model has no metric scale.
double MedianDistance(const Reconstruction& reconstruction);

// The reconstruction failed: fewer than 80 % of the scene's frames have a pose.
constexpr bool TooFewRegistered(std::size_t registered, std::size_t frames) {
  return registered * 10 < frames * 8;
}

enum class ModelQuality { kGood, kDoubtful, kFailed };
inline constexpr ChoiceNames<ModelQuality, 3> kModelQualityNames{
    {{"good", ModelQuality::kGood},
     {"doubtful", ModelQuality::kDoubtful},
     {"failed", ModelQuality::kFailed}}};

// Why a model is doubtful. The names are written to files and must not change; a new reason gets a
// new name. docs/files.md explains each reason and its figures.
enum class DoubtCode : std::uint8_t {
  kFewFrames,            // fewer than 80 % of the frames have a pose
  kParts,                // the clip breaks into parts, and this is one of them
  kOnlyTurns,            // a camera of another lens that only turns explains the tracks as well
  kWeakDepth,            // the depths are uncertain
  kUnexplainedParallax,  // the model does not explain much of the parallax
  kWorthless,            // the model does not represent the scene; normally there would be none
  kCameraContradicted,   // the tracks imply another camera than the given one
  kExcessNoise,          // the model leaves more noise than the tracks have
  kTwoCameras,           // two focal lengths explain the tracks equally well
  kFocalChanges,         // the tracks imply a focal length that changes
  kCenterMoves,          // the tracks imply a principal point that moves: a 2-D stabiliser
  kFocalUncertain,       // the focal length is uncertain
  kCamerasUncertain,     // the cameras' positions are uncertain
  kPointsOnALine,        // the points lie along a line
  kFewPoints,            // some of the frames are constrained by few points
  kThingsMove,           // much of the picture moves on its own
  kNoModelByCeres,       // COLMAP made a model of tracks for which Ceres makes none
  kNotJudged,            // COLMAP made the model, and Ceres did not judge it
  kOther,                // from a file of another version
};
inline constexpr ChoiceNames<DoubtCode, 19> kDoubtCodeNames{
    {{"few-frames", DoubtCode::kFewFrames},
     {"parts", DoubtCode::kParts},
     {"only-turns", DoubtCode::kOnlyTurns},
     {"weak-depth", DoubtCode::kWeakDepth},
     {"unexplained-parallax", DoubtCode::kUnexplainedParallax},
     {"worthless", DoubtCode::kWorthless},
     {"camera-contradicted", DoubtCode::kCameraContradicted},
     {"excess-noise", DoubtCode::kExcessNoise},
     {"two-cameras", DoubtCode::kTwoCameras},
     {"focal-changes", DoubtCode::kFocalChanges},
     {"center-moves", DoubtCode::kCenterMoves},
     {"focal-uncertain", DoubtCode::kFocalUncertain},
     {"cameras-uncertain", DoubtCode::kCamerasUncertain},
     {"points-on-a-line", DoubtCode::kPointsOnALine},
     {"few-points", DoubtCode::kFewPoints},
     {"things-move", DoubtCode::kThingsMove},
     {"no-model-by-ceres", DoubtCode::kNoModelByCeres},
     {"not-judged", DoubtCode::kNotJudged},
     {"other", DoubtCode::kOther}}};

// A reason to doubt a model (backend/scene/phrasebook.h).
struct Doubt {
  DoubtCode code = DoubtCode::kOther;
  std::string sentence;  // for people: what is doubtful and what to do
  // The named figures that the judgement is based on; a figure may be infinite.
  std::vector<std::pair<std::string, double>> figures = {};

  bool operator==(const Doubt&) const = default;
};

std::vector<std::string> SentencesOf(const std::vector<Doubt>& doubts);

// What frames outside the scene of a model show (FindAsides in backend/judge/aside.h).
enum class AsideKind : std::uint8_t { kBlank, kCard, kOtherScene };
inline constexpr ChoiceNames<AsideKind, 3> kAsideKindNames{
    {{"nothing", AsideKind::kBlank},
     {"still picture", AsideKind::kCard},
     {"other scene", AsideKind::kOtherScene}}};

// Frames first to last, both included.
struct Aside {
  FrameIndex first{};
  FrameIndex last{};
  AsideKind kind = AsideKind::kBlank;

  bool Has(FrameIndex frame) const { return first <= frame && frame <= last; }
  bool operator==(const Aside&) const = default;
};
bool AnyHas(const std::vector<Aside>& asides, FrameIndex frame);

// How a reconstruction ended.
struct ReconstructionSummary {
  std::size_t registered = 0;
  std::size_t frames = 0;        // of the clip
  std::size_t aside_frames = 0;  // those that do not show the scene of the model
  std::size_t points = 0;
  std::size_t observations = 0;
  double mean_track_length = 0.0;
  double mean_reprojection_px = 0.0;
  double seconds = 0.0;
  std::string termination;     // one line
  std::vector<Doubt> reasons;  // to doubt the model
  std::vector<Aside> asides;   // ascending

  std::size_t SceneFrames() const { return frames - aside_frames; }  // a model should have them all
  // Failed if there is no model, doubtful if there are reasons.
  ModelQuality Quality() const;
  // Points are checked too: given cameras have poses even if nothing was reconstructed.
  bool Failed() const { return points == 0 || TooFewRegistered(registered, SceneFrames()); }
  std::string WhyFailed() const;  // half a sentence
  std::string Brief() const;
};

// Notes what a model of these tracks takes over from their frames: the time stamps, times and
// repeats of those that it has registered.
void NoteFrames(const TrackFile& file, Reconstruction& reconstruction);

// Fills everything but seconds and termination. Of the reasons it adds only that too few frames
// registered. Repeats of registered frames count as registered; `frames` is the number of frames of
// the clip with its repeats, and `aside` that of the frames that do not show the scene.
ReconstructionSummary Summarize(const Reconstruction& reconstruction,
                                std::size_t frames,
                                std::size_t aside = 0);

}  // namespace cohort
