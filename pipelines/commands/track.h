#pragma once

#include "pipelines/console/command.h"

namespace cohort {

// Makes .tracks from INPUT (TrackClip) and prints the figures.
Command TrackCommand();

}  // namespace cohort
