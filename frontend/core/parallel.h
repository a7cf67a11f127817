#pragma once

#include <cstddef>
#include <functional>

namespace cohort {

// 0 means one thread per core.
std::size_t ThreadCount(unsigned threads);

// Calls work(0) ... work(count - 1), each once, in any order on `threads` threads.
// Rethrows an exception of the work and starts no further calls after it.
void ParallelFor(std::size_t count, unsigned threads, const std::function<void(std::size_t)>& work);

}  // namespace cohort
