#pragma once

#include <optional>
#include <string>

#include "backend/scene/reconstruction.h"
#include "datasets/readers/sequence.h"
#include "frontend/tracks/track_store.h"

namespace cohort {

// What there is to doubt of tracks before they are used: a warning each in the log, which says what
// to do. Of a file that is as it should be they say nothing.

// The run that wrote them did not end.
void WarnIfUnfinished(const TrackFile& file, const std::string& tracks);
// The clip is not what it was when they were made of it.
void WarnIfClipChanged(const TrackFile& file, const std::string& tracks, const Sequence& clip);
// The same, where the tracks are of a video whose frames are to be written as pictures.
void WarnIfVideoChanged(const TrackFile& file, const std::string& tracks);
// The model was made of others: the same ids were seen elsewhere. Throws Error where it cannot be
// theirs at all (CheckIsModelOf).
void WarnIfModelOfOthers(const Reconstruction& model,
                         const std::string& folder,
                         const TrackFile& file,
                         const std::string& tracks);
// Its focal lengths are of no lens, or its principal point lies outside the picture.
void WarnIfCameraDoubtful(const std::optional<Camera>& camera);

}  // namespace cohort
