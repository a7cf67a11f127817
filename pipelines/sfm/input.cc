#include "pipelines/sfm/input.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <opencv2/core.hpp>
#include <string_view>
#include <vector>

#include "datasets/readers/gray_image.h"
#include "frontend/core/statistics.h"
#include "frontend/geometry/camera_fault.h"
#include "frontend/geometry/camera_text.h"
#include "frontend/tracks/imported_tracks.h"
#include "pipelines/sfm/fingerprint.h"
#include "pipelines/sfm/kept_frames.h"

namespace cohort {
namespace {

Camera ParseCamera(const std::string& text, int width_px, int height_px) {
  std::vector<std::string> words;
  for (std::size_t at = 0; at <= text.size();) {
    const std::size_t comma = std::min(text.find(',', at), text.size());
    words.push_back(text.substr(at, comma - at));
    at = comma + 1;
  }
  try {
    Camera camera = CameraFromWords(words);
    camera.width_px = width_px;
    camera.height_px = height_px;
    return camera;
  } catch (const Error& error) {
    ThrowUsageError("--camera '{}': {}", text, error.what());
  }
}

// FOCAL_PX or FOCAL_PX+-SIGMA; the plus-minus sign is accepted, too.
Camera ParseCameraPrior(const std::string& text, int width_px, int height_px) {
  constexpr double kShareWithoutSigma = 0.1;
  const auto fail = [&text] {
    ThrowUsageError(
        "--camera-prior '{}': give a focal length in pixels and, if you know it, its standard "
        "deviation, both above 0, such as 1200 or 1200+-60",
        text);
  };
  const auto number = [&fail](std::string_view word) {
    double value = 0.0;
    const char* const end = word.data() + word.size();
    const auto [stop, error] = std::from_chars(word.data(), end, value);
    if (error != std::errc() || stop != end) fail();
    return value;
  };
  const std::string_view all(text);
  std::string_view focal = all;
  std::string_view sigma;
  for (const std::string_view sign : {"+-", "\u00b1"}) {
    const std::size_t at = focal.find(sign);
    if (at == std::string_view::npos) continue;
    focal = all.substr(0, at);
    sigma = all.substr(at + sign.size());
  }
  const double focal_px = number(focal);
  const double sigma_px =
      focal.size() == all.size() ? kShareWithoutSigma * focal_px : number(sigma);
  const Camera camera = Camera::Guess(width_px, height_px, focal_px, sigma_px / focal_px);
  // The ratio alone would accept two negative numbers.
  if (!FaultOf(camera).empty() || sigma_px <= 0.0) fail();
  return camera;
}

std::unique_ptr<MaskedSequence> WithMasks(std::unique_ptr<Sequence> sequence,
                                          const InputOptions& options,
                                          const MaskOptions& masks) {
  return std::make_unique<MaskedSequence>(
      std::move(sequence),
      ClipMasks(masks.mask),
      options.frames.empty(),
      masks.mask_fixed ? FixedPartsMask::kFind : FixedPartsMask::kNone);
}

}  // namespace

std::unique_ptr<Sequence> OpenInput(const InputOptions& options) {
  return OpenSequence(options.input,
                      options.layout,
                      options.frames.empty() ? FrameRange{} : FrameRange::Parse(options.frames));
}

std::unique_ptr<MaskedSequence> OpenInput(const InputOptions& options, const MaskOptions& masks) {
  return WithMasks(OpenInput(options), options, masks);
}

std::unique_ptr<MaskedSequence> OpenToTrack(const InputOptions& options, const MaskOptions& masks) {
  return WithMasks(KeepFrames(OpenInput(options)), options, masks);
}

std::unique_ptr<Sequence> OpenSource(const TrackFile& file, const std::string& tracks) {
  if (file.source.empty()) {
    ThrowError("{}: the pictures of the tracks did not come from files: give them by --images",
               tracks);
  }
  InputOptions input;
  input.input = file.source;
  input.frames = file.meta.frames;
  input.layout = ValueOf(kLayoutNames, file.meta.layout).value_or(Layout::kAuto);
  return OpenInput(input);
}

FrameInfo InfoOf(const Frame& frame) { return {frame.index, frame.name, frame.timestamp_ns}; }

TrackFile ReadFrames(Sequence& sequence, std::string_view stage, const StageProgress& progress) {
  TrackFile file;
  while (const auto frame = sequence.Next()) {
    file.frames.push_back(InfoOf(*frame));
    file.width_px = frame->gray.cols;
    file.height_px = frame->gray.rows;
    if (progress) progress(stage, file.frames.size(), sequence.FrameCount());
  }
  return file;
}

std::optional<Camera> GivenCamera(const InputOptions& options, int width_px, int height_px) {
  if (!options.camera.empty() && !options.camera_prior.empty()) {
    ThrowUsageError("--camera '{}' and --camera-prior '{}' exclude each other: give one of them",
                    options.camera,
                    options.camera_prior);
  }
  if (!options.camera.empty()) return ParseCamera(options.camera, width_px, height_px);
  if (options.camera_prior.empty()) return std::nullopt;
  return ParseCameraPrior(options.camera_prior, width_px, height_px);
}

std::optional<Camera> KnownCamera(const InputOptions& options,
                                  const Sequence& sequence,
                                  int width_px,
                                  int height_px) {
  if (const auto given = GivenCamera(options, width_px, height_px)) {
    return given->known ? given : std::nullopt;
  }
  return sequence.KnownCamera();
}

void NoteCamera(const Sequence& sequence, TrackFile& file) {
  NoteCamera(sequence.KnownCamera(), file);
  if (file.camera) return;
  if (const auto guess = sequence.FocalGuessOfFile()) {
    file.camera = Camera::Guess(file.width_px, file.height_px, guess->focal_px, guess->log_sigma);
    file.meta.focal_source = guess->source;
  }
}

void NoteCamera(const std::optional<Camera>& camera, TrackFile& file) {
  file.camera = camera;
  file.found_camera.reset();
  file.meta.focal_source.clear();
}

std::string DescribeFocalGuess(const TrackFile& file) {
  if (file.meta.focal_source.empty() || !file.camera) return "";
  return fmt::format(
      "the camera is not known; the reconstruction starts from {}, which gives a focal length of "
      "about {:.0f} px",
      file.meta.focal_source,
      file.camera->fx);
}

void DescribeInput(const InputOptions& options, const Sequence& sequence, TrackFile& file) {
  file.source = AbsolutePath(options.input);
  file.image_root = AbsolutePath(sequence.ImageRoot());
  file.meta.fingerprint = FingerprintOfFrames(sequence);
  file.meta.frames = options.frames;
  file.meta.layout = NameOf(kLayoutNames, options.layout);
  if (const auto given = GivenCamera(options, file.width_px, file.height_px)) {
    NoteCamera(given, file);
  } else {
    NoteCamera(sequence, file);
  }
  NoteSensorRows(sequence, file);
}

void NoteMask(const std::string& mask, TrackFile& file) {
  file.meta.mask = AbsolutePath(mask);
  file.meta.mask_fingerprint = FingerprintOfMasks(mask);
}

void NoteFixedParts(const MaskOptions& masks, const MaskedSequence& sequence, TrackFile& file) {
  if (!masks.mask_fixed) file.meta.fixed_parts = "off";
  if (!sequence.FixedPartsFound().empty()) file.meta.fixed_parts = kFixedPartsMasked;
}

FixedPartsMask FixedPartsOf(const TrackFile& file) {
  return file.meta.fixed_parts == kFixedPartsMasked ? FixedPartsMask::kFind : FixedPartsMask::kNone;
}

void NoteSensorRows(const Sequence& sequence, TrackFile& file) {
  file.meta.row_order = sequence.SensorRows();
}

bool IsStillTheClip(const TrackFile& file, const Sequence& sequence) {
  const std::string& was = file.meta.fingerprint;
  return was.empty() || was == FingerprintOfFrames(sequence);
}

void CheckCameraSize(const Camera& camera, int width_px, int height_px) {
  if (camera.width_px == width_px && camera.height_px == height_px) return;
  ThrowError(
      "the camera is for pictures of {}x{}, but these are {}x{}: give the camera of these pictures",
      camera.width_px,
      camera.height_px,
      width_px,
      height_px);
}

void CheckPictureSize(const TrackFile& file, const Frame& frame, const std::string& clip_name) {
  if (frame.gray.cols == file.width_px && frame.gray.rows == file.height_px) return;
  ThrowError(
      "the pictures of {} are {}x{}, but the tracks were made from {}x{}: give the same clip",
      clip_name,
      frame.gray.cols,
      frame.gray.rows,
      file.width_px,
      file.height_px);
}

std::string DoubtOfUnits(const TrackFile& file,
                         const std::string& name,
                         const TrackSet& tracks,
                         bool is_npz) {
  // Fewer say little about where the others would be.
  constexpr std::size_t kLeast = 20;
  std::vector<double> x;
  std::vector<double> y;
  for (const Observation& o : tracks.observations()) {
    if (!IsObserved(o)) continue;
    x.push_back(o.xy.x());
    y.push_back(o.xy.y());
  }
  if (x.size() < kLeast) return "";
  // Without the outliers of a tracker.
  constexpr double kFew = 0.02;
  const double right = Quantile(x, 1.0 - kFew);
  const double bottom = Quantile(y, 1.0 - kFew);
  const double least = std::min(Quantile(x, kFew), Quantile(y, kFew));
  constexpr double kOne = 1.1;
  if (least >= -kOne && std::max(right, bottom) <= kOne &&
      std::min(file.width_px, file.height_px) > 16) {
    const bool is_signed = least < -0.1;
    ThrowError("{}: its positions lie between {} and 1, not in pixels: {}",
               name,
               is_signed ? -1 : 0,
               !is_npz ? fmt::format("multiply x by the width and y by the height, {} and {}{}",
                                     file.width_px,
                                     file.height_px,
                                     is_signed ? ", after mapping them to 0..1" : "")
                       : fmt::format("if they are shares of the picture, give --npz.units {}",
                                     is_signed ? "minus-one-to-one" : "zero-to-one"));
  }
  // Tracks of pictures of half the size end here. Features may be in one quarter of the picture
  // alone, hence a warning.
  constexpr double kPart = 0.6;
  if (right > kPart * file.width_px || bottom > kPart * file.height_px) return "";
  return fmt::format(
      "{}: its positions lie in the top-left {:.0f} x {:.0f} px of pictures of {} x {}: if the "
      "tracker saw smaller pictures, {}",
      name,
      right,
      bottom,
      file.width_px,
      file.height_px,
      is_npz ? "give their size by --npz.size WxH" : "scale its positions to these");
}

std::string PredictOutside(const TrackFile& file,
                           const std::string& name,
                           const std::string& clip,
                           TrackSet& tracks) {
  const auto is_outside = [&file](const Observation& o) {
    return IsObserved(o) && !IsInPicture(o.xy, file.width_px, file.height_px);
  };
  const auto all = tracks.observations();
  const auto outside = std::count_if(all.begin(), all.end(), is_outside);
  if (outside == 0) return "";
  const auto observed = std::count_if(all.begin(), all.end(), IsObserved);
  ExtentOfTracks extent;
  for (const Observation& o : all) {
    if (IsObserved(o)) extent.Add(o.xy, file.width_px, file.height_px);
  }
  const bool exchanged = extent.FitsExchanged();
  if (2 * outside > observed) {
    ThrowError(
        "{}: {} of {} observed positions lie outside the pictures of {}, which are {} x {}: {}",
        name,
        outside,
        observed,
        clip,
        file.width_px,
        file.height_px,
        exchanged ? "exchange x and y, which makes them lie inside"
                  : "give the clip that the tracks were made from");
  }
  std::vector<Observation> observations(all.begin(), all.end());
  for (Observation& o : observations) {
    if (is_outside(o)) o.state = ObservationState::kPredicted;
  }
  tracks = TrackSet::Build(std::move(observations));
  return fmt::format("{}: {} observed positions lie outside the picture and count as predicted{}",
                     name,
                     outside,
                     exchanged ? "; they lie inside if x and y are exchanged" : "");
}

std::string WarningOfClip(const Sequence& sequence,
                          const TrackFile& file,
                          const std::string& input) {
  std::vector<std::string> warnings;
  if (!sequence.Warning().empty()) warnings.push_back(sequence.Warning());
  if (!IsStillTheClip(file, sequence)) {
    warnings.push_back(
        fmt::format("{} changed while it was read: the tracks may belong to two clips", input));
  }
  return fmt::format("{}", fmt::join(warnings, "; "));
}

std::string AbsolutePath(const std::filesystem::path& path) {
  return path.empty() ? "" : std::filesystem::absolute(path).lexically_normal().string();
}

std::string CanonicalPath(const std::filesystem::path& path) {
  std::error_code error;
  const auto canonical = std::filesystem::weakly_canonical(AbsolutePath(path), error);
  return error ? AbsolutePath(path) : canonical.string();
}

}  // namespace cohort
