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

struct NpzTracksOptions {
  NpzLayout layout = NpzLayout::kAuto;
  NpzOrigin origin = NpzOrigin::kPixelCentre;
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
             "Which axis of a .npz comes first; auto: the one that is as long as the input has "
             "frames is of frames. Needed where there are as many tracks.",
             Tier::kCommon);
    v.Choice("origin",
             o.origin,
             kNpzOriginNames,
             "What (0, 0) is in a .npz: the centre of the top-left pixel (CoTracker, VGGSfM, "
             "OpenCV), or its outer corner (TAPIR, TAPNext, COLMAP).",
             Tier::kCommon);
    v.Text("size",
           o.size,
           "The size WxH of the pictures that the tracks of a .npz were made on, where the input's "
           "is another, as 256x256: positions are scaled, x + 1/2 as W.",
           Tier::kCommon);
    v.Number("min_visibility",
             o.min_visibility,
             0.0,
             1.0,
             "Where the visibility in a .npz is a number from 0 to 1: positions of as "
             "much are observed, others predicted.",
             Tier::kCommon);
    v.Number("min_confidence",
             o.min_confidence,
             0.0,
             1e9,
             "Where a .npz has a confidence too: positions of less are predicted.",
             Tier::kCommon);
    v.Text("tracks", o.tracks, "name of the array of positions in a .npz, if it is another");
    v.Text("visibility",
           o.visibility,
           "name of the array of visibility in a .npz, if it is another; one that begins with "
           "occ, or has _occ, is of what is hidden");
  }
};

// Tracks as point trackers save them by np.savez, T x N or N x T, with or without a first axis of
// 1:
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
