#pragma once

#include "pipelines/console/command.h"

namespace cohort {

// .tracks -> model folder (ReconstructJob), and its summary printed. Throws Error after writing all
// there is where fewer than 80 % of the frames registered: a part of a clip is no reconstruction of
// it.
Command ReconstructCommand();

}  // namespace cohort
