#pragma once

#include <filesystem>
#include <span>
#include <string>

#include "frontend/core/options.h"
#include "frontend/tracks/imported_tracks.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// T frames, N tracks.
enum class NpzLayout { kAuto, kFramesFirst, kTracksFirst };
inline constexpr ChoiceNames<NpzLayout, 3> kNpzLayoutNames{
    {{"auto", NpzLayout::kAuto},
     {"frames-first", NpzLayout::kFramesFirst},
     {"tracks-first", NpzLayout::kTracksFirst}}};

// The position of (0, 0).
enum class NpzOrigin { kPixelCentre, kPixelCorner };
inline constexpr ChoiceNames<NpzOrigin, 2> kNpzOriginNames{
    {{"pixel-centre", NpzOrigin::kPixelCentre}, {"pixel-corner", NpzOrigin::kPixelCorner}}};

// The unit of the positions: pixels, or shares of the picture's width and height.
enum class NpzUnits { kPixels, kZeroToOne, kMinusOneToOne };
inline constexpr ChoiceNames<NpzUnits, 3> kNpzUnitsNames{
    {{"pixels", NpzUnits::kPixels},
     {"zero-to-one", NpzUnits::kZeroToOne},
     {"minus-one-to-one", NpzUnits::kMinusOneToOne}}};

// The order of a position's two numbers.
enum class NpzAxes { kXy, kYx };
inline constexpr ChoiceNames<NpzAxes, 2> kNpzAxesNames{
    {{"xy", NpzAxes::kXy}, {"yx", NpzAxes::kYx}}};

struct NpzTracksOptions {
  NpzLayout layout = NpzLayout::kAuto;
  NpzOrigin origin = NpzOrigin::kPixelCentre;
  NpzUnits units = NpzUnits::kPixels;
  NpzAxes axes = NpzAxes::kXy;
  std::string size = {};
  double min_visibility = 0.5;
  double min_confidence = 0.5;
  std::string tracks = {};
  std::string visibility = {};

  template <typename Self, typename Visitor>
  static void Visit(Self& o, Visitor& v) {
    v.Choice("layout",
             o.layout,
             kNpzLayoutNames,
             "Which axis of a .npz comes first. auto: the frame axis is the one whose length is "
             "the number of frames of the input. Needed if there are as many tracks as frames.",
             Tier::kCommon);
    v.Choice("origin",
             o.origin,
             kNpzOriginNames,
             "The position of (0, 0) in a .npz: the centre of the top-left pixel (CoTracker, "
             "VGGSfM, OpenCV), or its outer corner (TAPIR, TAPNext, COLMAP).",
             Tier::kCommon);
    v.Choice("units",
             o.units,
             kNpzUnitsNames,
             "The unit of the positions in a .npz: pixels, or shares of the picture's width and "
             "height from 0 to 1 or from -1 to 1.",
             Tier::kCommon);
    v.Choice("axes",
             o.axes,
             kNpzAxesNames,
             "The order of the two numbers of a position in a .npz.",
             Tier::kCommon);
    v.Text(
        "size",
        o.size,
        "The size WxH of the pictures from which the tracks of a .npz were made, such as 256x256, "
        "if it differs from that of the input. Positions are scaled: x + 1/2 in proportion to W.",
        Tier::kCommon);
    v.Number("min_visibility",
             o.min_visibility,
             0.0,
             1.0,
             "The visibility in a .npz from which a position counts as observed, if it is a number "
             "from 0 to 1; others are predicted.",
             Tier::kCommon);
    v.Number("min_confidence",
             o.min_confidence,
             0.0,
             1e9,
             "The confidence in a .npz below which positions are predicted, if it has one.",
             Tier::kCommon);
    v.Text("tracks",
           o.tracks,
           "name of the array of positions in a .npz, if it is not one of the usual names");
    v.Text("visibility",
           o.visibility,
           "name of the array of visibility in a .npz, if it is not one of the usual names; a name "
           "that begins with occ or contains _occ denotes occlusion");
  }
};

// Tracks as point trackers save them with np.savez, or the positions alone with np.save; T x N or N
// x T, with or without a first axis of 1:
//   tracks, pred_tracks                                   T x N x 2, pixels x, y
//   visibility, visibles, vis ... or occluded ...         T x N, bool or 0..1; without: all visible
//   confidence, conf, score ...                           T x N, optional
// and, as WriteTracksNpz writes them, also
//   track_ids N, frame_indices T (of the input; without them row t is its t-th frame),
//   residual T x N, covariance T x N x 3 (xx, xy, yy [px^2])
// A visible position is observed; a finite one that is not visible is predicted; one that is
// neither finite nor visible is skipped. Throws Error naming path and array on invalid input.
ImportedTracks ReadTracksNpz(const std::filesystem::path& path,
                             std::span<const FrameInfo> frames,
                             int width_px,
                             int height_px,
                             const NpzTracksOptions& options = {});

// Frames first; NaN where a track has no position. Includes frames without observations. Throws
// Error if the table of frames times tracks has more than 2^27 cells.
void WriteTracksNpz(const std::filesystem::path& path, const TrackFile& file);

}  // namespace cohort
