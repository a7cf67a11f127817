#pragma once

#include <future>
#include <optional>

#include "datasets/readers/sequence.h"
#include "frontend/core/worker.h"

namespace cohort {

// Decodes the next frame on a thread of its own while the caller works on the last one; where
// OpenCV has one thread (cv::setNumThreads), so has this. While a frame is awaited nobody else may
// read the sequence.
class ReadAhead {
 public:
  // `sequence` must outlive this.
  explicit ReadAhead(Sequence& sequence) : sequence_(sequence) {}

  // The sequence's next frame, or its error.
  std::optional<Frame> Next();
  // Begins to decode the one after it.
  void Begin();

 private:
  Sequence& sequence_;
  std::future<std::optional<Frame>> next_;
  Worker worker_;
};

}  // namespace cohort
