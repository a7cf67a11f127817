#pragma once

#include "pipelines/console/command.h"

namespace cohort {

// INPUT -> .tracks (TrackJob), and its figures printed.
Command TrackCommand();

}  // namespace cohort
