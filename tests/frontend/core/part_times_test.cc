#include "frontend/core/part_times.h"

#include <gtest/gtest.h>

namespace cohort {
namespace {

void Work(double ms) {
  const double end_ms = ThreadCpuMs() + ms;
  while (ThreadCpuMs() < end_ms) {
  }
}

TEST(PartTimes, APartWithinAnotherTakesItsTimeFromIt) {
  PartTimes times;
  const double start_ms = ThreadCpuMs();
  {
    const TimedPart outer("outer");
    Work(2.0);
    {
      const TimedPart inner("inner");
      Work(6.0);
    }
    Work(2.0);
  }
  const double all_ms = ThreadCpuMs() - start_ms;
  const double outer_ms = times.ms().at("outer");
  const double inner_ms = times.ms().at("inner");
  EXPECT_GE(outer_ms, 4.0);
  EXPECT_GE(inner_ms, 6.0);
  EXPECT_LE(outer_ms + inner_ms, all_ms) << "nothing is counted twice";
}

TEST(PartTimes, CountsWhileItIsAlive) {
  const TimedPart before("before");
  PartTimes times;
  { const TimedPart part("part"); }
  { const TimedPart part("part"); }
  EXPECT_EQ(times.ms().size(), 1u);
  EXPECT_EQ(times.ms().count("part"), 1u);
}

}  // namespace
}  // namespace cohort
