#pragma once

#include "pipelines/console/command.h"

namespace cohort {

// Darkens INPUT and keeps its ground truth (DegradeClip).
Command DegradeCommand();

}  // namespace cohort
