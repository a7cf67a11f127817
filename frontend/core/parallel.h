#pragma once

#include <cstddef>
#include <functional>

namespace cohort {

// 0 stands for one thread a core.
std::size_t ThreadCount(unsigned threads);

// Calls work(0) ... work(count - 1), each once, in any order on `threads` threads.
// Rethrows an exception of the work, after which no more of it is begun.
void ParallelFor(std::size_t count, unsigned threads, const std::function<void(std::size_t)>& work);

}  // namespace cohort
