#pragma once

#include "pipelines/console/command.h"

namespace cohort {

// Tracks or a model against the truth (EvaluateJob), printed.
Command EvaluateCommand();

}  // namespace cohort
