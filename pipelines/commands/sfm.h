#pragma once

#include "pipelines/console/command.h"

namespace cohort {

// INPUT -> scene folder (SfmJob), and how good it is in words. Throws Error after writing all there
// is where fewer than 80 % of the frames registered.
Command SfmCommand();

}  // namespace cohort
