#pragma once

#include <string>
#include <string_view>

#include "frontend/tracks/observation.h"

namespace cohort {

// The name of a frame that is no file, as of a video, under which it is written out for programs that
// want files: frame_000123.png.
std::string NumberedFrameName(FrameIndex frame);
// Is it one of these?
bool IsNumberedFrameName(std::string_view name);

}  // namespace cohort
