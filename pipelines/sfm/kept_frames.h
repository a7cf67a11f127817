#pragma once

#include <memory>

#include "datasets/readers/sequence.h"

namespace cohort {

// The sequence without its colours. A short clip (grey pictures of up to 256 MB) is decoded once
// and then read from memory, however often it is rewound: tracking reads a clip three times, the
// second pass up to three more.
std::unique_ptr<Sequence> KeepFrames(std::unique_ptr<Sequence> sequence);

}  // namespace cohort
