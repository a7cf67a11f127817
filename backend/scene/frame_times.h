#pragma once

#include <map>

#include "frontend/tracks/track_store.h"

namespace cohort {

// When the camera took each frame, in intervals between frames, relative to some frame; strictly
// ascending. Empty: frame i was taken at i.
using FrameTimes = std::map<FrameIndex, double>;

// From the time stamps of a clip's frames, in units of their median interval. Empty if these are
// evenly spaced (within .15 intervals of a straight line over the indices), missing or not
// ascending.
//
// With repeated frames there are two cases. Either the pictures were taken evenly and stored at a
// higher rate (24 per second at 30): then the stamps are those of storage, and the unit is the
// interval between pictures. Or the copies stand for pictures that were missed, and the stamps are
// right. In the first case the tracks move equally far from each picture to the next, in the second
// in proportion to the time between them; the case that fits the tracks better is chosen.
FrameTimes CaptureTimes(const TrackFile& file);

double TimeOf(const FrameTimes& times, FrameIndex frame);

}  // namespace cohort
