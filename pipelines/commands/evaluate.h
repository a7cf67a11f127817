#pragma once

#include "pipelines/console/command.h"

namespace cohort {

// Evaluates tracks or a model against the ground truth (Evaluate) and prints the result.
Command EvaluateCommand();

}  // namespace cohort
