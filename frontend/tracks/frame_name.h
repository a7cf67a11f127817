#pragma once

#include <string>
#include <string_view>

#include "frontend/tracks/observation.h"

namespace cohort {

// The name of a frame without a file, as in a video. Programs that need files get it under this
// name: frame_000123.png.
std::string NumberedFrameName(FrameIndex frame);
// Whether a name has this form.
bool IsNumberedFrameName(std::string_view name);

}  // namespace cohort
