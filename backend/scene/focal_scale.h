#pragma once

#include <map>

#include "frontend/geometry/camera.h"
#include "frontend/tracks/observation.h"
#include "frontend/tracks/track_set.h"

namespace cohort {

// Zoom and autofocus: a frame's focal length divided by that of the clip's camera. An unlisted
// frame has 1; an empty list means that the focal length does not change.
using FocalScales = std::map<FrameIndex, double>;

double FocalScaleOf(const FocalScales& scales, FrameIndex frame);

// The largest listed scale divided by the smallest; 1 for an empty list.
double ZoomOf(const FocalScales& scales);

// The camera of a frame: fx and fy times the frame's scale, the rest unchanged.
Camera CameraOf(const Camera& camera, const FocalScales& scales, FrameIndex frame);

// The positions as the camera would have seen them without zoom, at its own focal length.
TrackSet AtOneFocalLength(const TrackSet& tracks, const Camera& camera, const FocalScales& scales);

}  // namespace cohort
