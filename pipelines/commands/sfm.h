#pragma once

#include "pipelines/console/command.h"

namespace cohort {

// Makes a scene folder from INPUT (SfmJob) and prints its quality in words. If fewer than 80 % of
// the frames registered, it writes all results and then throws Error.
Command SfmCommand();

}  // namespace cohort
