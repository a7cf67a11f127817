#include "frontend/core/parallel.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

namespace cohort {
namespace {

using testing::Each;

TEST(ParallelFor, CallsEveryPieceOfWorkOnceWithAnyNumberOfThreads) {
  for (const unsigned threads : {0U, 1U, 2U, 7U}) {
    std::vector<int> calls(100, 0);
    ParallelFor(calls.size(), threads, [&](std::size_t i) { ++calls[i]; });
    EXPECT_THAT(calls, Each(1)) << threads << " threads";
  }
}

TEST(ParallelFor, ThrowsWhatTheWorkThrowsAndBeginsNoMore) {
  std::atomic<int> calls = 0;
  const auto fails = [&](std::size_t i) {
    ++calls;
    if (i == 3) throw std::runtime_error("the fourth");
  };
  EXPECT_THROW(ParallelFor(10, 3, fails), std::runtime_error);
  calls = 0;
  EXPECT_THROW(ParallelFor(10, 1, fails), std::runtime_error);
  EXPECT_EQ(calls, 4);
}

TEST(ParallelFor, OfNothingIsNothing) {
  ParallelFor(0, 4, [](std::size_t) { FAIL(); });
}

}  // namespace
}  // namespace cohort
