#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "datasets/open_sequence.h"
#include "frontend/core/options.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/sfm/masks.h"
#include "pipelines/sfm/progress.h"

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
             "How to read the input; only needed if its layout is not recognised.");
    v.Text("frames",
           o.frames,
           "Read only frames A to B - 1 of the input, given as A:B, or every STEP-th of them, "
           "A:B:STEP.",
           Tier::kCommon);
    v.Text("camera",
           o.camera,
           "The camera, fx,fy,cx,cy in pixels, followed by 1, 2, 4, 5 or 8 distortion coefficients "
           "if it has any: OpenCV's k1,k2,p1,p2,k3,k4,k5,k6. A fisheye lens is "
           "fx,fy,cx,cy,fisheye,k1,k2,k3,k4. (0, 0) is the centre of the top-left pixel. The "
           "default is the calibration of the input; an unknown camera is guessed and refined, and "
           "the reconstruction is less certain.",
           Tier::kCommon);
    v.Text("camera_prior",
           o.camera_prior,
           "A prior of the focal length of an unknown camera, FOCAL_PX or FOCAL_PX+-SIGMA in "
           "pixels, such as 1200+-60; the default of SIGMA is 10 %. The reconstruction starts from "
           "it and refines it. It replaces what the input gives, including a calibration. The "
           "default is the focal length in EXIF or in the video's metadata.",
           Tier::kCommon);
  }
};

std::unique_ptr<Sequence> OpenInput(const InputOptions& options);
// How its frames are masked, as the command line specifies.
struct MaskOptions {
  std::string mask;
  bool mask_fixed = true;

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Text("mask",
           o.mask,
           "A mask of the frames' size, black where no features are allowed, such as on the bonnet "
           "of a car; or a folder with a mask for each frame, NAME.png or NAME.jpg.png for the "
           "frame NAME.jpg, or Nerfstudio's transforms.json with their paths.",
           Tier::kCommon);
    v.Flag("mask_fixed",
           o.mask_fixed,
           "Also mask what stays fixed in the picture while the rest moves: burnt-in text, bars, "
           "a bonnet. --no-mask-fixed allows features there.",
           Tier::kCommon);
  }
};

// The same with these masks.
std::unique_ptr<MaskedSequence> OpenInput(const InputOptions& options, const MaskOptions& masks);
// The same for several readings of its grey pictures (KeepFrames).
std::unique_ptr<MaskedSequence> OpenToTrack(const InputOptions& options, const MaskOptions& masks);
// Opens the clip that the tracks were made from, as it was opened then; `tracks` names them. Throws
// Error if their pictures came from no file.
std::unique_ptr<Sequence> OpenSource(const TrackFile& file, const std::string& tracks);

// What a .tracks file records of a frame.
FrameInfo InfoOf(const Frame& frame);
// The frames of the sequence from the next one on, and their size, without tracks. Progress is that
// of `stage`.
TrackFile ReadFrames(Sequence& sequence,
                     std::string_view stage = {},
                     const StageProgress& progress = {});

// The camera given, or a guess by the prior given; nullopt if neither is. Throws UsageError on
// invalid text, and if both are given.
std::optional<Camera> GivenCamera(const InputOptions& options, int width_px, int height_px);
// The camera given, else the sequence's own, else nullopt. With a prior it is nullopt too: the
// camera is then not known. Throws UsageError as GivenCamera.
std::optional<Camera> KnownCamera(const InputOptions& options,
                                  const Sequence& sequence,
                                  int width_px,
                                  int height_px);

// Sets camera and meta.focal_source of `file`, whose picture size is set, from the sequence:
// its calibration, else a guess by its files, else nullopt.
void NoteCamera(const Sequence& sequence, TrackFile& file);
// Sets a camera that comes from elsewhere, or none.
void NoteCamera(const std::optional<Camera>& camera, TrackFile& file);
// A sentence on the source of the initial focal length. Empty if it came from no file.
std::string DescribeFocalGuess(const TrackFile& file);

// Fills in where the frames of `file`, whose picture size is set, come from: source, image_root,
// camera (the one or the prior given, else NoteCamera), meta.frames, meta.layout and, for
// files, meta.fingerprint (FingerprintOfFrames).
void DescribeInput(const InputOptions& options, const Sequence& sequence, TrackFile& file);

// Notes the path of the tracks' mask, which is also the default for the tracks of a refined file.
// Empty if there is none.
void NoteMask(const std::string& mask, TrackFile& file);
// TrackMeta::fixed_parts of a clip that has some.
inline constexpr const char* kFixedPartsMasked = "masked";
// Notes whether fixed parts are looked for and, once the first frame was read, whether they are
// masked.
void NoteFixedParts(const MaskOptions& masks, const MaskedSequence& sequence, TrackFile& file);
// Whether the tracks were made with fixed parts masked.
FixedPartsMask FixedPartsOf(const TrackFile& file);

// Notes how the clip's pictures were turned (TrackMeta::row_order), as DescribeInput does.
void NoteSensorRows(const Sequence& sequence, TrackFile& file);

// Whether the files of the clip are those that `file` was made from. True if it has no record.
bool IsStillTheClip(const TrackFile& file, const Sequence& sequence);
// Throws Error unless the camera's pictures have that size.
void CheckCameraSize(const Camera& camera, int width_px, int height_px);
// Throws Error if a frame of a clip does not have the size of those that `file` was made from.
void CheckPictureSize(const TrackFile& file, const Frame& frame, const std::string& clip_name);
// Marks positions outside the pictures of `file` as predicted, since no image confirms them (tracks
// of other programs). Returns a sentence on that, empty if there were none. Throws Error if they
// are most of the observed ones: then `tracks`, of that name, belong to another clip than `clip`.
std::string PredictOutside(const TrackFile& file,
                           const std::string& name,
                           const std::string& clip,
                           TrackSet& tracks);
// Throws Error if the positions of `tracks`, of that name, are not in pixels: nearly all lie
// between -1 and 1. Returns a sentence if they fill only the top-left part of the pictures, as
// those of smaller pictures do; else empty. `is_npz`: whether options can correct it.
std::string DoubtOfUnits(const TrackFile& file,
                         const std::string& name,
                         const TrackSet& tracks,
                         bool is_npz);
// TrackMeta::warning of a clip that was read, with DescribeInput's entries in `file`; empty if
// there is none.
std::string WarningOfClip(const Sequence& sequence,
                          const TrackFile& file,
                          const std::string& input);

// Absolute and without dots, as .tracks files store inputs; empty stays empty.
std::string AbsolutePath(const std::filesystem::path& path);
// The same for every spelling of a path, also through links: for comparisons.
std::string CanonicalPath(const std::filesystem::path& path);

}  // namespace cohort
