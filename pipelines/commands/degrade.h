#pragma once

#include "pipelines/console/command.h"

namespace cohort {

// INPUT -> the same clip in the dark, with its truth (DegradeJob).
Command DegradeCommand();

}  // namespace cohort
