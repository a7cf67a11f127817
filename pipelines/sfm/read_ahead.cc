#include "pipelines/sfm/read_ahead.h"

#include <opencv2/core/utility.hpp>

namespace cohort {

std::optional<Frame> ReadAhead::Next() { return next_.valid() ? next_.get() : sequence_.Next(); }

void ReadAhead::Begin() {
  if (cv::getNumThreads() <= 1 || next_.valid() || !sequence_.AnyThreadMayRead()) return;
  next_ = worker_.Begin([this] { return sequence_.Next(); });
}

}  // namespace cohort
