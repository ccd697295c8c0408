#include "server/http/task_queue.h"

#include <atomic>
#include <future>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/process.h"

namespace isomesh::http {
namespace {

TEST(BoundedTaskQueue, RunsEveryTask) {
  std::atomic<int> runs = 0;
  BoundedTaskQueue queue(4, 8);
  for (int n = 0; n < 1000; ++n) queue.enqueue([&] { ++runs; });
  queue.shutdown();
  EXPECT_EQ(runs, 1000);
}

TEST(BoundedTaskQueue, RunsTasksSideBySide) {
  std::promise<void> second_ran;
  BoundedTaskQueue queue(2, 8);
  queue.enqueue([&] { second_ran.get_future().wait_for(test::kLongest); });
  std::atomic<bool> ran = false;
  queue.enqueue([&] {
    ran = true;
    second_ran.set_value();
  });
  queue.shutdown();
  EXPECT_TRUE(ran);
}

TEST(BoundedTaskQueue, RunsWhatItAcceptedBeforeItEnds) {
  std::atomic<int> runs = 0;
  std::promise<void> go;
  BoundedTaskQueue queue(1, 8);
  queue.enqueue([&] { go.get_future().wait(); });
  for (int n = 0; n < 5; ++n) queue.enqueue([&] { ++runs; });
  std::jthread ending([&] { queue.shutdown(); });
  go.set_value();
  ending.join();
  EXPECT_EQ(runs, 5);
}

TEST(BoundedTaskQueue, HoldsBackWhoeverFillsIt) {
  std::promise<void> go;
  std::atomic<int> accepted = 0;
  std::atomic<bool> running = false;
  BoundedTaskQueue queue(1, 2);
  queue.enqueue([&] {
    running = true;
    go.get_future().wait();
  });
  ASSERT_TRUE(test::eventually([&] { return running.load(); }));
  std::jthread accepting([&] {
    for (int n = 0; n < 5; ++n) {
      queue.enqueue([] {});
      ++accepted;
    }
  });
  ASSERT_TRUE(test::eventually([&] { return accepted == 2; }));
  EXPECT_EQ(accepted, 2);
  go.set_value();
  EXPECT_TRUE(test::eventually([&] { return accepted == 5; }));
}

TEST(BoundedTaskQueue, EndsTwiceWithoutHarm) {
  BoundedTaskQueue queue(2, 2);
  queue.shutdown();
  queue.shutdown();
}

}  // namespace
}  // namespace isomesh::http
