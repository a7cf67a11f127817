#pragma once

#include <future>
#include <optional>

#include "datasets/readers/sequence.h"
#include "frontend/core/worker.h"

namespace cohort {

// Decodes the next frame on its own thread while the caller works on the last one, but not if
// OpenCV has one thread (cv::setNumThreads). No other code may read the sequence while a frame is
// awaited.
class ReadAhead {
 public:
  // `sequence` must outlive this.
  explicit ReadAhead(Sequence& sequence) : sequence_(sequence) {}

  // The sequence's next frame, or its error.
  std::optional<Frame> Next();
  // Starts decoding the frame after it.
  void Begin();

 private:
  Sequence& sequence_;
  std::future<std::optional<Frame>> next_;
  Worker worker_;
};

}  // namespace cohort
