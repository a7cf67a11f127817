#include "frontend/tracks/track_npz.h"

#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <initializer_list>
#include <limits>
#include <set>
#include <vector>

#include "frontend/core/error.h"
#include "frontend/storage/npz.h"
#include "frontend/tracks/text_rows.h"

namespace cohort {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMaxCells = std::size_t{1} << 27;
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// The names under which trackers and their users save the arrays; the first existing one counts.
constexpr std::initializer_list<const char*> kTrackNames = {"tracks", "pred_tracks", "pred_track"};
constexpr std::initializer_list<const char*> kVisibilityNames = {"visibility",
                                                                 "visibilities",
                                                                 "visibles",
                                                                 "visible",
                                                                 "vis",
                                                                 "pred_visibility",
                                                                 "pred_visibilities",
                                                                 "pred_visibles",
                                                                 "pred_vis",
                                                                 "pred_vis_scores",
                                                                 "occluded",
                                                                 "pred_occluded",
                                                                 "occlusion",
                                                                 "occlusions"};
constexpr std::initializer_list<const char*> kConfidenceNames = {"confidence",
                                                                 "confidences",
                                                                 "conf",
                                                                 "vis_conf",
                                                                 "pred_confidence",
                                                                 "pred_conf",
                                                                 "pred_confs",
                                                                 "pred_score"};

struct Size {
  double width;
  double height;
};

Size ParseSize(const std::string& text) {
  const std::size_t x = std::min(text.find('x'), text.size());
  const auto width = Parse<int>(std::string_view(text).substr(0, x));
  const auto height =
      x < text.size() ? Parse<int>(std::string_view(text).substr(x + 1)) : std::nullopt;
  if (!width || !height || *width < 1 || *height < 1) {
    ThrowUsageError("--npz.size '{}' is not a size in pixels: give WxH, such as 256x256", text);
  }
  return {static_cast<double>(*width), static_cast<double>(*height)};
}

// The arrays of one file, with frames as the first axis.
class TracksReader {
 public:
  TracksReader(const fs::path& path,
               std::span<const FrameInfo> frames,
               const NpzTracksOptions& options)
      : npz_(path), path_(path.string()), options_(options) {
    tracks_name_ = Required();
    NpzArray tracks = npz_.Read(tracks_name_, 2 * kMaxCells);
    DropBatch(tracks, 3);
    if (tracks.shape.size() != 3 || tracks.shape[2] != 2 || tracks.kind == NpzKind::kBool) {
      Fail(tracks_name_,
           fmt::format("it is {}: positions are frames x tracks x 2 or tracks x frames x 2",
                       ShapeText(tracks.shape)));
    }
    ReadFrames(frames);
    Decide(tracks.shape);
    tracks_ = std::move(tracks.values);
  }

  std::size_t frame_count() const { return frames_.size(); }
  std::size_t track_count() const { return track_count_; }
  FrameIndex Frame(std::size_t t) const { return frames_[t]; }
  Eigen::Vector2d Position(std::size_t t, std::size_t n) const {
    const std::size_t at = 2 * Cell(t, n);
    if (options_.axes == NpzAxes::kYx) return {tracks_[at + 1], tracks_[at]};
    return {tracks_[at], tracks_[at + 1]};
  }
  std::size_t Cell(std::size_t t, std::size_t n) const {
    return frames_first_ ? t * track_count_ + n : n * frames_.size() + t;
  }
  std::size_t PositionCount() const {
    std::size_t count = 0;
    for (std::size_t i = 0; i + 1 < tracks_.size(); i += 2) {
      if (std::isfinite(tracks_[i]) && std::isfinite(tracks_[i + 1])) ++count;
    }
    return count;
  }
  const std::string& tracks_name() const { return tracks_name_; }

  // The values of the cells; empty if the file has no such array.
  std::vector<double> Cells(const std::string& name, std::size_t values_a_cell) {
    NpzArray array = npz_.Read(name, values_a_cell * kMaxCells);
    std::vector<std::size_t> shape{frames_.size(), track_count_};
    if (!frames_first_) std::swap(shape[0], shape[1]);
    if (values_a_cell > 1) shape.push_back(values_a_cell);
    DropBatch(array, shape.size());
    if (values_a_cell == 1 && array.shape.size() == 3 && array.shape.back() == 1) {
      array.shape.pop_back();
    }
    if (array.shape != shape) {
      Fail(name,
           fmt::format("it is {} instead of {}, the shape of {}",
                       ShapeText(array.shape),
                       ShapeText(shape),
                       tracks_name_));
    }
    return std::move(array.values);
  }

  std::string Find(std::initializer_list<const char*> names) const {
    for (const char* name : names) {
      if (npz_.Has(name)) return name;
    }
    return {};
  }
  bool Has(const std::string& name) const { return npz_.Has(name); }
  NpzArray Read(const std::string& name) { return npz_.Read(name, kMaxCells); }

  [[noreturn]] void Fail(const std::string& array, const std::string& why) const {
    ThrowError("{}, array {}: {}", path_, array, why);
  }

 private:
  std::string Required() const {
    std::string name = options_.tracks.empty() ? Find(kTrackNames) : options_.tracks;
    if (!name.empty() && npz_.Has(name)) return name;
    ThrowError(
        "{} has no array {}, but {}: give the name of the array of positions by --npz.tracks",
        path_,
        name.empty() ? "tracks" : name,
        npz_.names().empty() ? "none" : fmt::format("{}", fmt::join(npz_.names(), ", ")));
  }

  // Removes an additional first axis of 1.
  static void DropBatch(NpzArray& array, std::size_t dimensions) {
    while (array.shape.size() > dimensions && array.shape.front() == 1) {
      array.shape.erase(array.shape.begin());
    }
  }

  void ReadFrames(std::span<const FrameInfo> frames) {
    for (const char* name : {"frame_indices", "frame_index", "frame_ids", "frames"}) {
      if (!npz_.Has(name)) continue;
      // An array `frames` may be the pictures themselves.
      const NpzReader::Description about = npz_.Describe(name);
      if (about.shape.size() != 1 || about.kind != NpzKind::kInteger) continue;
      const NpzArray indices = npz_.Read(name, kMaxCells);
      std::set<FrameIndex> known;
      for (const FrameInfo& frame : frames) known.insert(frame.index);
      for (const double index : indices.values) {
        const bool fits = index >= 0 && index <= std::numeric_limits<std::uint32_t>::max();
        if (!fits || !known.contains(FrameIndex{static_cast<std::uint32_t>(index)})) {
          const bool from_one = index == static_cast<double>(frames.size()) &&
                                std::ranges::find(indices.values, 0.0) == indices.values.end();
          Fail(name,
               fmt::format("frame {} is not among the {} of the input{}",
                           index,
                           frames.size(),
                           from_one ? ": frames count from 0, not from 1" : ""));
        }
        frames_.push_back(FrameIndex{static_cast<std::uint32_t>(index)});
      }
      if (frames_.empty()) Fail(name, "it lists no frame");
      const std::set<FrameIndex> once(frames_.begin(), frames_.end());
      if (once.size() != frames_.size()) Fail(name, "a frame occurs twice");
      return;
    }
    for (const FrameInfo& frame : frames) frames_.push_back(frame.index);
  }

  // Decides which axis is the frame axis.
  void Decide(const std::vector<std::size_t>& shape) {
    const bool first = shape[0] == frames_.size();
    const bool second = shape[1] == frames_.size();
    if (options_.layout == NpzLayout::kAuto && first && second) {
      Fail(tracks_name_,
           fmt::format("it is {}, as many tracks as frames: give the order by --npz.layout "
                       "frames-first or tracks-first",
                       ShapeText(shape)));
    }
    frames_first_ =
        options_.layout == NpzLayout::kAuto ? first : options_.layout == NpzLayout::kFramesFirst;
    if (frames_first_ ? !first : !second) {
      Fail(tracks_name_,
           fmt::format("it is {}, and {} is the {} frames of the input: select the tracked frames "
                       "by --frames, or save their numbers as an array frame_indices",
                       ShapeText(shape),
                       options_.layout == NpzLayout::kAuto ? "neither axis"
                       : frames_first_                     ? "not its first axis"
                                                           : "not its second axis",
                       frames_.size()));
    }
    track_count_ = frames_first_ ? shape[1] : shape[0];
  }

  NpzReader npz_;
  std::string path_;
  const NpzTracksOptions& options_;
  std::string tracks_name_;
  std::vector<FrameIndex> frames_;
  std::size_t track_count_ = 0;
  bool frames_first_ = true;
  std::vector<double> tracks_;
};

bool MeansHidden(const std::string& name) {
  return name.starts_with("occ") || name.find("_occ") != std::string::npos;
}

// Whether each cell is visible; empty if all are.
std::vector<bool> ReadVisible(TracksReader& reader, const NpzTracksOptions& options) {
  std::string name = options.visibility;
  if (!name.empty() && !reader.Has(name)) reader.Fail(name, "there is none of this name");
  if (name.empty()) name = reader.Find(kVisibilityNames);
  std::vector<bool> visible;
  if (!name.empty()) {
    for (const double value : reader.Cells(name, 1)) {
      if (!(value >= 0.0 && value <= 1.0)) {
        reader.Fail(name,
                    fmt::format("{} is not a probability: save bool, or numbers from 0 to 1 (the "
                                "sigmoid of a network's output)",
                                value));
      }
      visible.push_back((MeansHidden(name) ? 1.0 - value : value) >= options.min_visibility);
    }
  }
  const std::string confidence = reader.Find(kConfidenceNames);
  if (confidence.empty()) return visible;
  const std::vector<double> confidences = reader.Cells(confidence, 1);
  if (visible.empty()) visible.assign(confidences.size(), true);
  for (std::size_t i = 0; i < confidences.size(); ++i) {
    if (!(confidences[i] >= options.min_confidence)) visible[i] = false;
  }
  return visible;
}

std::vector<FeatureId> ReadTrackIds(TracksReader& reader) {
  std::vector<FeatureId> ids;
  if (!reader.Has("track_ids")) {
    for (std::size_t n = 0; n < reader.track_count(); ++n) {
      ids.push_back(FeatureId{static_cast<std::uint32_t>(n)});
    }
    return ids;
  }
  const NpzArray array = reader.Read("track_ids");
  if (array.kind != NpzKind::kInteger || array.shape.size() != 1 ||
      array.shape[0] != reader.track_count()) {
    reader.Fail(
        "track_ids",
        fmt::format(
            "it is {} instead of {} integers", ShapeText(array.shape), reader.track_count()));
  }
  std::set<FeatureId> once;
  for (const double id : array.values) {
    if (!(id >= 0.0 && id <= std::numeric_limits<std::uint32_t>::max())) {
      reader.Fail("track_ids", fmt::format("{} needs more than 32 bits", id));
    }
    ids.push_back(FeatureId{static_cast<std::uint32_t>(id)});
    if (!once.insert(ids.back()).second)
      reader.Fail("track_ids", fmt::format("{} occurs twice", id));
  }
  return ids;
}

std::optional<PixelCovariance> CovarianceOf(const TracksReader& reader,
                                            const std::vector<double>& covariances,
                                            std::size_t cell,
                                            const Eigen::Array2d& scale) {
  const double xx = covariances[3 * cell];
  const double xy = covariances[3 * cell + 1];
  const double yy = covariances[3 * cell + 2];
  if (std::isnan(xx) && std::isnan(xy) && std::isnan(yy)) return std::nullopt;
  if (!PixelCovariance::IsOne(xx, xy, yy)) {
    reader.Fail(
        "covariance",
        fmt::format("xx {}, xy {}, yy {} is not a positive definite covariance", xx, xy, yy));
  }
  const Eigen::Matrix2d scaled = scale.matrix().asDiagonal() * Eigen::Matrix2d{{xx, xy}, {xy, yy}} *
                                 scale.matrix().asDiagonal();
  if (!PixelCovariance::IsOne(scaled(0, 0), scaled(0, 1), scaled(1, 1))) {
    reader.Fail("covariance", "it overflows when it is scaled to the size of the pictures");
  }
  return PixelCovariance::From(scaled);
}

}  // namespace

ImportedTracks ReadTracksNpz(const fs::path& path,
                             std::span<const FrameInfo> frames,
                             int width_px,
                             int height_px,
                             const NpzTracksOptions& options) {
  ValidateOptions(options);
  const Size size{static_cast<double>(width_px), static_cast<double>(height_px)};
  const Size made_on = options.size.empty() ? size : ParseSize(options.size);
  const Eigen::Array2d picture(made_on.width, made_on.height);  // [px] of the tracker's pictures
  const Eigen::Array2d scale(size.width / made_on.width, size.height / made_on.height);
  const Eigen::Array2d unit = options.units == NpzUnits::kPixels      ? Eigen::Array2d(1.0, 1.0)
                              : options.units == NpzUnits::kZeroToOne ? picture
                                                                      : (picture / 2.0).eval();
  const Eigen::Array2d zero =
      options.units == NpzUnits::kMinusOneToOne ? (picture / 2.0).eval() : Eigen::Array2d(0.0, 0.0);
  // Distance of the file's (0, 0) from the corner of the top-left pixel.
  const double shift = options.origin == NpzOrigin::kPixelCentre ? 0.5 : 0.0;
  const bool as_it_is = options.origin == NpzOrigin::kPixelCentre && (scale == 1.0).all() &&
                        options.units == NpzUnits::kPixels;

  TracksReader reader(path, frames, options);
  const std::vector<bool> visible = ReadVisible(reader, options);
  const std::vector<FeatureId> ids = ReadTrackIds(reader);
  std::vector<double> residuals;
  if (reader.Has("residual")) residuals = reader.Cells("residual", 1);
  std::vector<double> covariances;
  if (reader.Has("covariance")) covariances = reader.Cells("covariance", 3);

  ImportedTracks result;
  std::vector<Observation> observations;
  observations.reserve(reader.PositionCount());  // growing would hold them twice in memory
  ExtentOfTracks extent;
  for (std::size_t n = 0; n < reader.track_count(); ++n) {
    for (std::size_t t = 0; t < reader.frame_count(); ++t) {
      const std::size_t cell = reader.Cell(t, n);
      const Eigen::Vector2d xy = reader.Position(t, n);
      const bool is_visible = visible.empty() ? !xy.hasNaN() : visible[cell];
      if (!xy.allFinite()) {
        if (!is_visible) continue;
        reader.Fail(reader.tracks_name(),
                    fmt::format("track {} in frame {} is {}, {} and visible",
                                n,
                                ToInt(reader.Frame(t)),
                                xy.x(),
                                xy.y()));
      }
      Observation o{.feature = ids[n], .frame = reader.Frame(t)};
      o.xy = as_it_is ? xy : ((xy.array() * unit + zero + shift) * scale - 0.5).matrix();
      const bool inside = IsInPicture(o.xy, width_px, height_px);
      if (is_visible) extent.Add(o.xy, width_px, height_px);
      if (is_visible && !inside) ++result.left_out;
      if (!is_visible || !inside) o.state = ObservationState::kPredicted;
      if (!residuals.empty() && std::isfinite(residuals[cell])) o.residual = residuals[cell];
      if (!covariances.empty())
        o.covariance = CovarianceOf(reader, covariances, cell, unit * scale);
      observations.push_back(o);
    }
  }
  if (observations.empty()) reader.Fail(reader.tracks_name(), "it has no position");
  result.fits_exchanged = extent.FitsExchanged();
  if (2 * result.left_out > extent.observed) {
    reader.Fail(reader.tracks_name(),
                fmt::format("{} of {} visible positions lie outside the picture of {} x {}: if the "
                            "tracker {}",
                            result.left_out,
                            extent.observed,
                            width_px,
                            height_px,
                            10 * extent.within_one > 9 * extent.observed
                                ? "gives shares from -1 to 1, give --npz.units minus-one-to-one"
                            : result.fits_exchanged
                                ? "gives y before x, give --npz.axes yx"
                                : "saw pictures of another size, give that size by --npz.size"));
  }
  result.tracks = TrackSet::Build(std::move(observations));
  return result;
}

void WriteTracksNpz(const fs::path& path, const TrackFile& file) {
  const auto features = file.tracks.features();
  const std::size_t columns = features.size();
  if (columns > 0 && file.frames.size() > kMaxCells / columns) {
    ThrowError(
        "cannot write {}: {} frames times {} tracks are too many cells; use --csv, which has rows "
        "only for existing positions",
        path.string(),
        file.frames.size(),
        columns);
  }
  const std::size_t shape[] = {file.frames.size(), columns, 2};
  const std::size_t covariance_shape[] = {file.frames.size(), columns, 3};
  std::vector<std::int64_t> track_ids;
  std::vector<std::int64_t> frame_indices;
  for (const FeatureId feature : features) track_ids.push_back(ToInt(feature));
  for (const FrameInfo& frame : file.frames) frame_indices.push_back(ToInt(frame.index));
  // Frame by frame, because most cells of a long clip are empty, and all together may take many GB.
  const auto each = [&](std::size_t t, const auto& visit) {
    auto column = features.begin();
    for (const Observation* o : file.tracks.InFrame(file.frames[t].index)) {
      column = std::lower_bound(column, features.end(), o->feature);
      visit(static_cast<std::size_t>(column - features.begin()), *o);
    }
  };
  NpzWriter npz(path);
  npz.AddRows("tracks", shape, [&](std::size_t t, std::span<double> xy) {
    std::ranges::fill(xy, kNaN);
    each(t, [&](std::size_t column, const Observation& o) {
      xy[2 * column] = o.xy.x();
      xy[2 * column + 1] = o.xy.y();
    });
  });
  npz.AddBoolRows(
      "visibility", std::span(shape).first(2), [&](std::size_t t, std::span<std::uint8_t> visible) {
        std::ranges::fill(visible, 0);
        each(t, [&](std::size_t column, const Observation& o) {
          visible[column] = IsObserved(o) ? 1 : 0;
        });
      });
  npz.AddRows(
      "residual", std::span(shape).first(2), [&](std::size_t t, std::span<double> residuals) {
        std::ranges::fill(residuals, kNaN);
        each(t, [&](std::size_t column, const Observation& o) { residuals[column] = o.residual; });
      });
  npz.AddRows("covariance", covariance_shape, [&](std::size_t t, std::span<float> covariances) {
    std::ranges::fill(covariances, std::numeric_limits<float>::quiet_NaN());
    each(t, [&](std::size_t column, const Observation& o) {
      if (!o.covariance) return;
      covariances[3 * column] = o.covariance->xx;
      covariances[3 * column + 1] = o.covariance->xy;
      covariances[3 * column + 2] = o.covariance->yy;
    });
  });
  npz.Add("track_ids", std::span(shape).subspan(1, 1), std::span<const std::int64_t>(track_ids));
  npz.Add("frame_indices", std::span(shape).first(1), std::span<const std::int64_t>(frame_indices));
  npz.Commit();
}

}  // namespace cohort
