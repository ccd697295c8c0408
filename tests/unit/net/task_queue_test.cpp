#include "server/net/task_queue.h"

#include <atomic>
#include <future>

#include <gtest/gtest.h>

#include "tests/support/process.h"

namespace isomesh::net {
namespace {

TEST(BoundedTaskQueue, RunsEveryTask) {
  std::atomic<int> runs = 0;
  BoundedTaskQueue queue(4, 1000);
  for (int n = 0; n < 1000; ++n) EXPECT_TRUE(queue.try_enqueue([&] { ++runs; }));
  queue.shutdown();
  EXPECT_EQ(runs, 1000);
}

TEST(BoundedTaskQueue, RunsTasksSideBySide) {
  std::promise<void> second_ran;
  BoundedTaskQueue queue(2, 8);
  queue.try_enqueue([&] { second_ran.get_future().wait_for(test::kLongest); });
  std::atomic<bool> ran = false;
  queue.try_enqueue([&] {
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
  queue.try_enqueue([&] { go.get_future().wait(); });
  for (int n = 0; n < 5; ++n) queue.try_enqueue([&] { ++runs; });
  std::jthread ending([&] { queue.shutdown(); });
  go.set_value();
  ending.join();
  EXPECT_EQ(runs, 5);
  EXPECT_FALSE(queue.try_enqueue([] {}));
}

TEST(BoundedTaskQueue, RefusesWhatItHasNoRoomFor) {
  std::promise<void> go;
  std::promise<void> running;
  BoundedTaskQueue queue(1, 2);
  queue.try_enqueue([&] {
    running.set_value();
    go.get_future().wait();
  });
  running.get_future().wait();
  EXPECT_TRUE(queue.try_enqueue([] {}));
  EXPECT_TRUE(queue.try_enqueue([] {}));
  EXPECT_FALSE(queue.try_enqueue([] {}));
  go.set_value();
  EXPECT_TRUE(test::eventually([&] { return queue.try_enqueue([] {}); }));
}

TEST(BoundedTaskQueue, EndsTwiceWithoutHarm) {
  BoundedTaskQueue queue(2, 2);
  queue.shutdown();
  queue.shutdown();
}

}  // namespace
}  // namespace isomesh::net
