#pragma once

#include <optional>
#include <string>

#include "backend/scene/reconstruction.h"
#include "datasets/readers/sequence.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/sfm/second_pass.h"

namespace cohort {

// What there is to doubt of tracks before they are used (sfm/doubts.h): a warning each in the log.

// Nothing where it is empty.
void WarnOf(const std::string& doubt);

// The run that wrote them did not end.
void WarnIfUnfinished(const TrackFile& file, const std::string& tracks);
void WarnIfClipChanged(const TrackFile& file, const std::string& tracks, const Sequence& clip);
// The clip changed, where the tracks are of a video whose frames are to be written as pictures.
void WarnIfVideoChanged(const TrackFile& file, const std::string& tracks);
void WarnIfModelOfOthers(const Reconstruction& model,
                         const std::string& folder,
                         const TrackFile& file,
                         const std::string& tracks);
void WarnIfSceneDiffers(const SecondPassFigures& figures);
void WarnIfCameraDoubtful(const std::optional<Camera>& camera);

// That a file of the clip says the focal length, of which the reconstruction starts: no doubt, but
// what users should know.
void TellFocalGuess(const TrackFile& file);

}  // namespace cohort
