#pragma once

#include <map>

#include "frontend/geometry/camera.h"
#include "frontend/tracks/observation.h"
#include "frontend/tracks/track_set.h"

namespace cohort {

// Zoom and autofocus: how many times the focal length of a clip's camera a frame's is. It is 1 for a
// frame that is not listed; an empty list: the focal length does not change.
using FocalScales = std::map<FrameIndex, double>;

double FocalScaleOf(const FocalScales& scales, FrameIndex frame);

// The largest over the smallest of those listed; 1 of an empty list.
double ZoomOf(const FocalScales& scales);

// The camera of a frame: fx and fy times the frame's scale, the rest as it is.
Camera CameraOf(const Camera& camera, const FocalScales& scales, FrameIndex frame);

// The positions as the camera would have seen them without zoom, at its own focal length.
TrackSet AtOneFocalLength(const TrackSet& tracks, const Camera& camera, const FocalScales& scales);

}  // namespace cohort
