#pragma once

#include <filesystem>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <string>

#include "datasets/open_sequence.h"
#include "frontend/core/options.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// Which frames to read, as the command line names them.
struct InputOptions {
  std::string input;
  Layout layout = Layout::kAuto;
  std::string frames;
  std::string camera;
  std::string camera_prior;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Text("input",
           o.input,
           "The video: a file, a folder or glob of images, or a folder in TUM RGB-D, EuRoC"
           " or KITTI layout.",
           Tier::kCommon);
    v.Choice("layout",
             o.layout,
             kLayoutNames,
             "How to read the input; only needed where its layout is not recognised.");
    v.Text("frames",
           o.frames,
           "Take only frames A to B - 1 of the input, given as A:B, or every STEP-th of "
           "them, A:B:STEP.",
           Tier::kCommon);
    v.Text("camera",
           o.camera,
           "The camera, fx,fy,cx,cy in pixels, with 1, 2, 4, 5 or 8 distortion coefficients "
           "behind them if it has any: OpenCV's k1,k2,p1,p2,k3,k4,k5,k6. A fisheye lens is "
           "fx,fy,cx,cy,fisheye,k1,k2,k3,k4. (0, 0) is the centre of the top-left pixel. Without "
           "it, what the input says; a camera that is not known is guessed and refined, and the "
           "reconstruction is less sure.",
           Tier::kCommon);
    v.Text("camera_prior",
           o.camera_prior,
           "What is thought of the focal length of a camera that is not known, FOCAL_PX or "
           "FOCAL_PX+-SIGMA in pixels, such as 1200+-60; without SIGMA it is 10 %. The "
           "reconstruction starts there and refines it. It takes the place of what the input "
           "says, of a calibration too. Without it, what EXIF or the video's metadata say.",
           Tier::kCommon);
  }
};

std::unique_ptr<Sequence> OpenInput(const InputOptions& options);
// The clip that the tracks were made of, opened as it was then; `tracks` names them. Throws Error
// where their pictures came from no file.
std::unique_ptr<Sequence> OpenSource(const TrackFile& file, const std::string& tracks);

// The camera given, or a guess by the prior given; none: neither is. Throws UsageError on another
// text, and on both.
std::optional<Camera> GivenCamera(const InputOptions& options, int width_px, int height_px);
// The camera given, else the sequence's own, else none; none where a prior is given: that camera is
// not known. Throws UsageError as GivenCamera.
std::optional<Camera> KnownCamera(const InputOptions& options,
                                  const Sequence& sequence,
                                  int width_px,
                                  int height_px);

// In .tracks: what in the clip's files says the focal length of the camera, which is a guess.
inline constexpr const char* kFocalSourceMeta = "focal_source";
// Sets camera and meta[kFocalSourceMeta] of `file`, whose picture size is set, to what the sequence
// says: its calibration, else a guess by its files, else none.
void NoteCamera(const Sequence& sequence, TrackFile& file);
// Sets it to one that comes from elsewhere, or to none.
void NoteCamera(const std::optional<Camera>& camera, TrackFile& file);
// Where the start of the focal length comes from: a sentence. Empty where no file said it.
std::string DescribeFocalGuess(const TrackFile& file);

// Fills in where the frames of `file`, whose picture size is set, come from: source, image_root,
// camera (the one or the prior given, else NoteCamera), meta["frames"], meta["layout"] and, of files, meta["fingerprint"] (FingerprintOfFrames).
void DescribeInput(const InputOptions& options, const Sequence& sequence, TrackFile& file);

// Notes the mask, by its path, that tracks were made with: those of a refined file are by default,
// too. Empty: none.
void NoteMask(const std::string& mask, TrackFile& file);

// Notes how the clip's pictures were turned (RowOrderOf), as DescribeInput does.
void NoteSensorRows(const Sequence& sequence, TrackFile& file);

// Are the files of the clip those that `file` was made of? Where it does not know it may be.
bool IsStillTheClip(const TrackFile& file, const Sequence& sequence);
// Throws Error unless a camera is of pictures of that size.
void CheckCameraSize(const Camera& camera, int width_px, int height_px);
// Throws Error where a frame of a clip has not the size of those that `file` was made of.
void CheckPictureSize(const TrackFile& file, const Frame& frame, const std::string& clip_name);
// What lies outside the pictures of `file` no image confirms: of tracks of others it becomes
// predicted. Returns what to say of that; empty: there was nothing. Throws Error where they are
// most of the observed ones: then `tracks`, so named, are of another clip than `clip`.
std::string PredictOutside(const TrackFile& file,
                           const std::string& name,
                           const std::string& clip,
                           TrackSet& tracks);
// In .tracks: what was wrong with the clip, as that it ended before its last frame.
inline constexpr const char* kWarningMeta = "warning";
// The same of a clip that was read, whose DescribeInput `file` has; empty: nothing.
std::string WarningOfClip(const Sequence& sequence,
                          const TrackFile& file,
                          const std::string& input);

// Absolute and without dots, as a .tracks file names input; empty stays empty.
std::string AbsolutePath(const std::filesystem::path& path);
// The same for every spelling of a path, also through links: to compare by.
std::string CanonicalPath(const std::filesystem::path& path);

// CV_8UC1, 0 where no feature may be. Empty without a path; throws Error naming one that is no
// picture, or black all over.
cv::Mat ReadMask(const std::string& path);
// Throws Error where a mask, of this name, is.
void CheckMaskIsOpen(const cv::Mat& mask, const std::string& name);

}  // namespace cohort
