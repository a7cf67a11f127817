#pragma once

#include <string>

#include "backend/scene/reconstruction.h"
#include "datasets/readers/sequence.h"
#include "frontend/tracks/track_csv.h"
#include "frontend/tracks/track_store.h"
#include "pipelines/sfm/second_pass.h"

namespace cohort {

// What there is to doubt of tracks before they are used: a sentence that says what to do; empty
// where all is as it should be. The names are for the sentence.

// The clip is not what it was when they were made of it.
std::string DoubtOfClip(const TrackFile& file,
                        const std::string& tracks_name,
                        const Sequence& clip);
// The mask that they were made with, of the same name, is not what it was.
std::string DoubtOfMask(const TrackFile& file, const std::string& tracks_name);
// The model was made of others: the same ids were seen elsewhere. Throws Error where it cannot be
// theirs at all: its camera is of another size, or it has a frame or a point that they do not have.
std::string DoubtOfModel(const Reconstruction& model,
                         const std::string& model_name,
                         const TrackFile& file,
                         const std::string& tracks_name);
// Measured again where the model has them, more tracks were lost than replaced: the scene is not as
// the model says.
std::string DoubtOfMeasuring(const SecondPassFigures& figures);
// Its track ids are not those of the file.
std::string DoubtOfIds(const TracksCsv& csv, const std::string& tracks_name);
// Its focal lengths are of no lens, or its principal point lies outside the picture.
std::string DoubtOfCamera(const Camera& camera);

}  // namespace cohort
