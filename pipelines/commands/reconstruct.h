#pragma once

#include "pipelines/console/command.h"

namespace cohort {

// Makes a model folder from .tracks (ReconstructFile) and prints its summary. If fewer than 80 % of
// the frames registered, it writes all results and then throws Error, because a part is not a
// reconstruction of the clip.
Command ReconstructCommand();

}  // namespace cohort
