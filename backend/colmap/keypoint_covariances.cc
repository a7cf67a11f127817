#include "backend/colmap/keypoint_covariances.h"

#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "frontend/storage/npz.h"
#include "frontend/tracks/text_rows.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

struct Keypoint {
  const FrameInfo* frame;
  std::uint32_t index;
  const Observation* observation;
};

Eigen::Vector2f InColmapPixels(const Keypoint& keypoint) {
  return (keypoint.observation->xy + Eigen::Vector2d::Constant(kColmapPixelShift)).cast<float>();
}

// A field of CSV, quoted if necessary.
std::string Quoted(const std::string& text) {
  if (text.find_first_of(",\"\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + '"';
}

void WriteCsv(const fs::path& path, const std::vector<Keypoint>& keypoints) {
  TextOutput out(path);
  out.Text("image_id,image_name,keypoint,track_id,x,y,cov_xx,cov_xy,cov_yy").EndLine();
  for (const Keypoint& keypoint : keypoints) {
    const Observation& o = *keypoint.observation;
    const Eigen::Vector2f xy = InColmapPixels(keypoint);
    out.Number(ColmapImageIdOf(o.frame)).Text(",").Text(Quoted(keypoint.frame->name)).Text(",");
    out.Number(keypoint.index).Text(",").Number(ToInt(o.feature)).Text(",");
    out.Number(xy.x()).Text(",").Number(xy.y());
    if (o.covariance) {
      out.Text(",").Number(o.covariance->xx).Text(",").Number(o.covariance->xy);
      out.Text(",").Number(o.covariance->yy).EndLine();
    } else {
      out.Text(",,,").EndLine();
    }
  }
  out.Commit();
}

void WriteNpz(const fs::path& path,
              const std::vector<Keypoint>& keypoints,
              const std::vector<FrameInfo>& frames) {
  std::vector<std::int64_t> image_id, keypoint_index, track_id, image_ids;
  std::vector<std::string> image_names;
  std::vector<float> xy;
  std::vector<double> covariance;
  for (const FrameInfo& frame : frames) {
    image_ids.push_back(ColmapImageIdOf(frame.index));
    image_names.push_back(frame.name);
  }
  for (const Keypoint& keypoint : keypoints) {
    const Observation& o = *keypoint.observation;
    image_id.push_back(ColmapImageIdOf(o.frame));
    keypoint_index.push_back(keypoint.index);
    track_id.push_back(ToInt(o.feature));
    const Eigen::Vector2f at = InColmapPixels(keypoint);
    xy.insert(xy.end(), {at.x(), at.y()});
    Eigen::Matrix2d matrix = Eigen::Matrix2d::Constant(std::numeric_limits<double>::quiet_NaN());
    if (o.covariance) matrix = o.covariance->Matrix();
    covariance.insert(covariance.end(), {matrix(0, 0), matrix(0, 1), matrix(1, 0), matrix(1, 1)});
  }
  const std::size_t shape[] = {keypoints.size(), 2, 2};
  const std::size_t images[] = {frames.size()};
  const std::span one = std::span(shape).first(1);
  NpzWriter npz(path);
  npz.Add("image_id", one, std::span<const std::int64_t>(image_id));
  npz.Add("keypoint", one, std::span<const std::int64_t>(keypoint_index));
  npz.Add("track_id", one, std::span<const std::int64_t>(track_id));
  npz.Add("xy", std::span(shape).first(2), std::span<const float>(xy));
  npz.Add("covariance", shape, std::span<const double>(covariance));
  npz.Add("image_ids", images, std::span<const std::int64_t>(image_ids));
  npz.AddTexts("image_names", image_names);
  npz.Commit();
}

}  // namespace

CovarianceCounts WriteKeypointCovariances(const fs::path& path,
                                          const TrackFile& file,
                                          const ColmapDatabaseOptions& options) {
  ValidateOptions(options);
  const TrackFile strong = WithoutWeakObservations(file, options);
  std::vector<Keypoint> keypoints;
  CovarianceCounts counts;
  for (const FrameInfo& frame : strong.frames) {
    std::uint32_t index = 0;
    for (const Observation* o : ColmapKeypoints(strong.tracks, frame.index)) {
      keypoints.push_back({&frame, index++, o});
      if (!o->covariance) ++counts.without;
    }
  }
  counts.keypoints = keypoints.size();
  if (counts.without == counts.keypoints) {
    ThrowError(
        "cannot write {}: no position has a covariance; `cohort track` and `cohort refine` "
        "measure them, other trackers do not",
        path.string());
  }
  if (path.extension() == ".npz") {
    WriteNpz(path, keypoints, strong.frames);
  } else {
    WriteCsv(path, keypoints);
  }
  return counts;
}

}  // namespace cohort
