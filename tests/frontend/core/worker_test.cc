#include "frontend/core/worker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <set>
#include <thread>
#include <vector>

#include "frontend/core/error.h"

namespace cohort {
namespace {

TEST(Worker, DoesAllInOrderOnOneThreadThatIsNotTheCallers) {
  Worker worker;
  std::vector<int> order;
  std::set<std::thread::id> threads;
  std::vector<std::future<int>> results;
  for (int i = 0; i < 20; ++i) {
    results.push_back(worker.Begin([&, i] {
      order.push_back(i);
      threads.insert(std::this_thread::get_id());
      return 10 * i;
    }));
  }
  for (int i = 0; i < 20; ++i) EXPECT_EQ(results[i].get(), 10 * i);
  EXPECT_TRUE(std::is_sorted(order.begin(), order.end()));
  EXPECT_EQ(threads.size(), 1);
  EXPECT_FALSE(threads.contains(std::this_thread::get_id()));
}

TEST(Worker, GivesAnErrorToWhoAsksAndGoesOn) {
  Worker worker;
  auto fails = worker.Begin([] { ThrowError("frame 7 is damaged"); });
  auto works = worker.Begin([] { return 1; });
  EXPECT_THAT([&] { fails.get(); }, testing::ThrowsMessage<Error>("frame 7 is damaged"));
  EXPECT_EQ(works.get(), 1);
}

TEST(Worker, WaitsAtItsEndForWhatHasBegun) {
  bool ended = false;
  {
    Worker worker;
    std::promise<void> begun;
    worker.Begin([&] {
      begun.set_value();
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      ended = true;
    });
    begun.get_future().wait();
  }
  EXPECT_TRUE(ended);
}

}  // namespace
}  // namespace cohort
