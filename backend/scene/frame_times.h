#pragma once

#include <map>

#include "frontend/tracks/track_store.h"

namespace cohort {

// When the camera took each frame, in intervals between frames from some frame on; strictly
// ascending. Empty: frame i was taken at i.
using FrameTimes = std::map<FrameIndex, double>;

// By the time stamps of a clip's frames, in units of their median interval. Empty if these are even
// (within .15 intervals of a straight line over the frames' indices), missing or not ascending.
//
// With repeated frames there are two cases. Pictures were taken evenly and stored at a higher rate
// (24 a second at 30): the stamps are those of the storing, and the unit is the interval between
// pictures. Or the copies stand for pictures that were missed, and the stamps are right. In the
// first case the tracks move equally far from each picture to the next, in the second in proportion
// to the time between them; what suits the tracks better counts.
FrameTimes CaptureTimes(const TrackFile& file);

double TimeOf(const FrameTimes& times, FrameIndex frame);

}  // namespace cohort
