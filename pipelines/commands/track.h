#pragma once

#include "pipelines/console/command.h"

namespace cohort {

// Makes .tracks from INPUT (TrackJob) and prints the figures.
Command TrackCommand();

}  // namespace cohort
