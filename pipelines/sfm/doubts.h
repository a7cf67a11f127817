#pragma once

#include <optional>
#include <string>

#include "backend/scene/reconstruction.h"
#include "datasets/readers/sequence.h"
#include "frontend/tracks/track_csv.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/sfm/second_pass.h"

namespace cohort {

// Checks of tracks before they are used. Each returns a sentence that states what to do, or an
// empty string if there is no doubt. The names are for the sentence.

// The clip has changed since the tracks were made.
std::string DoubtOfClip(const TrackFile& file,
                        const std::string& tracks_name,
                        const Sequence& clip);
// The same of a video whose frames are to be written as pictures.
std::string DoubtOfVideo(const TrackFile& file, const std::string& tracks_name);
// The mask of that name has changed since the tracks were made.
std::string DoubtOfMask(const TrackFile& file, const std::string& tracks_name);
// The model was made from other tracks: the same ids have other positions. Throws Error if it
// cannot belong to them: its camera has another size, or it has a frame or a point that they lack.
std::string DoubtOfModel(const Reconstruction& model,
                         const std::string& model_name,
                         const TrackFile& file,
                         const std::string& tracks_name);
// Measuring lost more tracks than it replaced: the scene does not match the model.
std::string DoubtOfMeasuring(const SecondPassFigures& figures);
// The track ids are not those of the file.
std::string DoubtOfIds(const TracksCsv& csv, const std::string& tracks_name);
// The focal lengths are unrealistic, or the principal point lies outside the picture.
std::string DoubtOfCamera(const std::optional<Camera>& known);

}  // namespace cohort
