#pragma once

#include <cstddef>
#include <opencv2/core/utility.hpp>

namespace cohort {

// Calls work(0) ... work(count - 1), each once, in any order, on as many threads as OpenCV has
// (cv::setNumThreads).
template <typename Work>
void ForEachInParallel(std::size_t count, const Work& work) {
  cv::parallel_for_(cv::Range(0, static_cast<int>(count)), [&](const cv::Range& range) {
    for (int i = range.start; i < range.end; ++i) work(static_cast<std::size_t>(i));
  });
}

}  // namespace cohort
