#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <string_view>

namespace cohort {

// Called after every frame with the progress of a job. `stage`: "look", "track", "learn", "measure"
// or "write frames"; `total` is unset if unknown. An exception from it ends the job.
using StageProgress =
    std::function<void(std::string_view stage, std::size_t done, std::optional<std::size_t> total)>;

}  // namespace cohort
