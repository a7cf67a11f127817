#include "backend/colmap/tracks_to_database.h"

#include <Eigen/LU>
#include <limits>
#include <map>
#include <set>
#include <string>

#include "frontend/core/statistics.h"

namespace cohort {
namespace {

ColmapPairConfig ToPairConfig(TwoViewKind kind) {
  switch (kind) {
    case TwoViewKind::kCalibrated:
      return ColmapPairConfig::kCalibrated;
    case TwoViewKind::kUncalibrated:
      return ColmapPairConfig::kUncalibrated;
    case TwoViewKind::kPlanar:
      return ColmapPairConfig::kPlanar;
    case TwoViewKind::kPanoramic:
      return ColmapPairConfig::kPanoramic;
    case TwoViewKind::kDegenerate:
      return ColmapPairConfig::kDegenerate;
  }
  return ColmapPairConfig::kUndefined;
}

// Our pixels x and COLMAP's S x, S the shift of the origin: F -> S^-T F S^-1, H -> S H S^-1.
ColmapTwoViewGeometry InColmapPixels(const TwoViewGeometry& geometry, bool camera_known) {
  Eigen::Matrix3d back = Eigen::Matrix3d::Identity();  // S^-1
  back(0, 2) = back(1, 2) = -kColmapPixelShift;
  ColmapTwoViewGeometry result;
  result.config = ToPairConfig(geometry.kind);
  if (geometry.fundamental) {
    result.fundamental = back.transpose() * *geometry.fundamental * back;
  }
  if (geometry.homography) result.homography = back.inverse() * *geometry.homography * back;
  if (camera_known) {  // with a guessed focal length these are not meaningful
    result.essential = geometry.essential;
    result.cam2_from_cam1 = geometry.cam2_from_cam1;
  }
  return result;
}

// The index of every feature's keypoint in an image.
using KeypointIndex = std::map<FeatureId, std::uint32_t>;

KeypointIndex IndexKeypoints(const TrackFile& file, FrameIndex frame) {
  KeypointIndex index;
  for (const Observation* o : ColmapKeypoints(file.tracks, frame)) {
    const auto next = static_cast<std::uint32_t>(index.size());
    index[o->feature] = next;
  }
  return index;
}

ColmapImage ToColmapImage(const TrackFile& file, const FrameInfo& frame) {
  ColmapImage image;
  image.name = frame.name;
  for (const Observation* o : ColmapKeypoints(file.tracks, frame.index)) {
    const Eigen::Vector2d xy = o->xy + Eigen::Vector2d::Constant(kColmapPixelShift);
    if (xy.cwiseAbs().maxCoeff() > double{std::numeric_limits<float>::max()}) {
      ThrowError(
          "track {} is at {:.1e}, {:.1e} in frame {}, which COLMAP cannot represent: leave the "
          "track out",
          ToInt(o->feature),
          o->xy.x(),
          o->xy.y(),
          ToInt(o->frame));
    }
    image.keypoints.push_back(xy.cast<float>());
  }
  return image;
}

void CheckFrames(const TrackFile& file) {
  std::set<std::string> names;
  std::set<FrameIndex> frames;
  for (const FrameInfo& frame : file.frames) {
    if (frame.name.empty()) ThrowError("frame {} has no name", ToInt(frame.index));
    if (!names.insert(frame.name).second) {
      ThrowError("two frames are named {}: COLMAP needs a name for each", frame.name);
    }
    frames.insert(frame.index);
  }
  for (const FrameIndex frame : file.tracks.frames()) {
    if (!frames.contains(frame)) {
      ThrowError("the tracks have positions in frame {}, which is not in the list of frames",
                 ToInt(frame));
    }
  }
}

// Pairs of frames 1, 2, 4, 8 ... apart, on a grid of half the distance.
std::set<std::pair<FrameIndex, FrameIndex>> PairFrames(const std::vector<FrameInfo>& frames,
                                                       int max_stride) {
  std::set<std::pair<FrameIndex, FrameIndex>> pairs;
  for (std::size_t stride = 1;
       stride < frames.size() && stride <= static_cast<std::size_t>(max_stride);
       stride *= 2) {
    const std::size_t step = std::max<std::size_t>(1, stride / 2);
    for (std::size_t i = 0; i + stride < frames.size(); i += step) {
      pairs.emplace(frames[i].index, frames[i + stride].index);
    }
  }
  return pairs;
}

// The map of pixels from a camera without distortion to one with another focal length:
// x -> S x, S = diag(scale, scale, 1) about the principal point.
Eigen::Matrix3d Zoom(const Camera& camera, double scale) {
  Eigen::Matrix3d zoom = Eigen::Vector3d(scale, scale, 1.0).asDiagonal();
  zoom.topRightCorner<2, 1>() = (1.0 - scale) * Eigen::Vector2d(camera.cx, camera.cy);
  return zoom;
}

// Converts the geometry of two pictures at a common focal length to that at their own:
// F -> S2^-T F S1^-1, H -> S2 H S1^-1.
void ZoomPictures(const Eigen::Matrix3d& zoom1,
                  const Eigen::Matrix3d& zoom2,
                  TwoViewGeometry& geometry) {
  const Eigen::Matrix3d back1 = zoom1.inverse();
  if (geometry.fundamental) {
    geometry.fundamental = zoom2.inverse().transpose() * *geometry.fundamental * back1;
  }
  if (geometry.homography) geometry.homography = zoom2 * *geometry.homography * back1;
}

ColmapPair ToColmapPair(const FramePairMatches& shared,
                        const KeypointIndex& index1,
                        const KeypointIndex& index2,
                        const Camera& camera,
                        const TwoViewOptions& options,
                        double scale1,
                        double scale2) {
  TwoViewGeometry geometry = EstimateTwoViewGeometry(shared.xy1, shared.xy2, camera, options);
  if (scale1 != 1.0 || scale2 != 1.0) {
    ZoomPictures(Zoom(camera, scale1), Zoom(camera, scale2), geometry);
  }
  ColmapPair pair;
  if (geometry.kind != TwoViewKind::kDegenerate) {
    pair.geometry = InColmapPixels(geometry, camera.known);
  }
  for (std::size_t m = 0; m < shared.features.size(); ++m) {
    const ColmapMatch match{index1.at(shared.features[m]), index2.at(shared.features[m])};
    pair.matches.push_back(match);
    if (pair.geometry && geometry.inlier[m]) pair.geometry->inliers.push_back(match);
  }
  return pair;
}

}  // namespace

TrackFile WithoutWeakObservations(const TrackFile& file, const ColmapDatabaseOptions& options) {
  const auto variance = [](const Observation& o) {
    return 0.5 * (double{o.covariance->xx} + double{o.covariance->yy});
  };
  std::vector<double> of_clip;
  std::map<FrameIndex, std::vector<double>> of_frame;
  for (const Observation& o : file.tracks.observations()) {
    if (o.state != ObservationState::kObserved || !o.covariance) continue;
    of_clip.push_back(variance(o));
    of_frame[o.frame].push_back(variance(o));
  }
  if (of_clip.empty() || options.max_relative_sigma == 0.0) return file;
  const double clip_median = Median(std::move(of_clip));
  std::map<FrameIndex, double> most;
  for (auto& [frame, variances] : of_frame) {
    const double reference = std::max(clip_median, Median(std::move(variances)));
    most[frame] = options.max_relative_sigma * options.max_relative_sigma * reference;
  }
  std::vector<Observation> observations(file.tracks.observations().begin(),
                                        file.tracks.observations().end());
  const auto is_weak = [&](const Observation& o) {
    return o.state == ObservationState::kObserved && o.covariance && variance(o) > most.at(o.frame);
  };
  TrackFile strong = file;
  for (Observation& o : observations) {
    if (is_weak(o)) o.state = ObservationState::kPredicted;
  }
  strong.tracks = TrackSet::Build(std::move(observations),
                                  {file.tracks.ends().begin(), file.tracks.ends().end()});
  return strong;
}

std::vector<const Observation*> ColmapKeypoints(const TrackSet& tracks, FrameIndex frame) {
  std::vector<const Observation*> keypoints;
  for (const Observation* o : tracks.InFrame(frame)) {
    if (IsObserved(*o)) keypoints.push_back(o);
  }
  return keypoints;
}

ColmapDatabase BuildColmapDatabase(
    const TrackFile& file,
    const ColmapDatabaseOptions& options,
    const std::vector<std::pair<FrameIndex, FrameIndex>>& extra_pairs,
    const FocalScales& focal_scale) {
  ValidateOptions(options);
  CheckFrames(file);
  const Camera camera = file.camera.value_or(Camera::Guess(file.width_px, file.height_px));
  ColmapDatabase database;
  database.camera = ToColmapCamera(camera);
  std::map<FrameIndex, KeypointIndex> keypoints;
  for (const FrameInfo& frame : file.frames) {
    keypoints[frame.index] = IndexKeypoints(file, frame.index);
    database.images[ColmapImageIdOf(frame.index)] = ToColmapImage(file, frame);
    if (focal_scale.empty()) continue;
    database.camera_of_image[ColmapImageIdOf(frame.index)] =
        ToColmapCamera(CameraOf(camera, focal_scale, frame.index));
  }
  const TrackSet tracks = AtOneFocalLength(file.tracks, camera, focal_scale);
  auto frame_pairs = PairFrames(file.frames, options.max_stride);
  frame_pairs.insert(extra_pairs.begin(), extra_pairs.end());
  for (const auto& [frame1, frame2] : frame_pairs) {
    const FramePairMatches shared = MatchFrames(tracks, frame1, frame2);
    if (shared.features.size() < static_cast<std::size_t>(options.two_view.min_inliers)) continue;
    database.AddPair(ColmapImageIdOf(frame1),
                     ColmapImageIdOf(frame2),
                     ToColmapPair(shared,
                                  keypoints.at(frame1),
                                  keypoints.at(frame2),
                                  camera,
                                  options.two_view,
                                  FocalScaleOf(focal_scale, frame1),
                                  FocalScaleOf(focal_scale, frame2)));
  }
  return database;
}

void WriteColmapDatabase(const std::filesystem::path& path,
                         const TrackFile& file,
                         const ColmapDatabaseOptions& options,
                         const FocalScales& focal_scale) {
  ValidateOptions(options);
  WriteColmapDatabase(
      path, BuildColmapDatabase(WithoutWeakObservations(file, options), options, {}, focal_scale));
}

}  // namespace cohort
