#pragma once

#include <optional>
#include <string>

#include "backend/scene/reconstruction.h"
#include "datasets/readers/sequence.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/sfm/second_pass.h"

namespace cohort {

// Checks tracks before they are used (sfm/doubts.h); each doubt is a warning in the log.

// Does nothing if the text is empty.
void WarnOf(const std::string& doubt);

void WarnIfClipChanged(const TrackFile& file, const std::string& tracks, const Sequence& clip);
// The same for tracks of a video whose frames are to be written as pictures.
void WarnIfVideoChanged(const TrackFile& file, const std::string& tracks);
void WarnIfModelOfOthers(const Reconstruction& model,
                         const std::string& folder,
                         const TrackFile& file,
                         const std::string& tracks);
void WarnIfSceneDiffers(const SecondPassFigures& figures);
void WarnIfCameraDoubtful(const std::optional<Camera>& camera);

// Reports that the reconstruction starts from a focal length in the clip's files. This is
// information, not a doubt.
void TellFocalGuess(const TrackFile& file);

}  // namespace cohort
