#include "server/net/task_queue.h"

#include <algorithm>
#include <atomic>
#include <future>
#include <string>

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "tests/support/process.h"

namespace isomesh::net {
namespace {

TEST(BoundedTaskQueue, RunsEveryTask) {
  std::atomic<int> runs = 0;
  BoundedTaskQueue queue(4, 1000);
  for (int n = 0; n < 1000; ++n) EXPECT_TRUE(queue.try_enqueue("", [&] { ++runs; }));
  queue.shutdown();
  EXPECT_EQ(runs, 1000);
}

TEST(BoundedTaskQueue, RunsTasksSideBySide) {
  std::promise<void> second_ran;
  BoundedTaskQueue queue(2, 8);
  queue.try_enqueue("", [&] { second_ran.get_future().wait_for(test::kLongest); });
  std::atomic<bool> ran = false;
  queue.try_enqueue("", [&] {
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
  queue.try_enqueue("", [&] { go.get_future().wait(); });
  for (int n = 0; n < 5; ++n) queue.try_enqueue("", [&] { ++runs; });
  std::jthread ending([&] { queue.shutdown(); });
  go.set_value();
  ending.join();
  EXPECT_EQ(runs, 5);
  EXPECT_FALSE(queue.try_enqueue("", [] {}));
}

TEST(BoundedTaskQueue, RefusesWhatItHasNoRoomFor) {
  std::promise<void> go;
  std::promise<void> running;
  BoundedTaskQueue queue(1, 2);
  queue.try_enqueue("", [&] {
    running.set_value();
    go.get_future().wait();
  });
  running.get_future().wait();
  EXPECT_TRUE(queue.try_enqueue("", [] {}));
  EXPECT_TRUE(queue.try_enqueue("", [] {}));
  EXPECT_FALSE(queue.try_enqueue("", [] {}));
  go.set_value();
  EXPECT_TRUE(test::eventually([&] { return queue.try_enqueue("", [] {}); }));
}

// One thread, so that the order is seen.
TEST(BoundedTaskQueue, PartiesTakeTurns) {
  std::promise<void> go;
  std::string order;
  {
    BoundedTaskQueue queue(1, 100);
    queue.try_enqueue("z", [&] { go.get_future().wait(); });
    for (const char* party : {"a", "a", "a", "a", "b", "c", "b"}) {
      EXPECT_TRUE(queue.try_enqueue(party, [&order, party] { order += party; }));
    }
    go.set_value();
  }
  EXPECT_EQ(order, "abcabaa");
}

TEST(BoundedTaskQueue, WhoeverFillsTheQueueLeavesRoomForOthers) {
  std::promise<void> go;
  BoundedTaskQueue queue(1, 8);
  queue.try_enqueue("", [&] { go.get_future().wait(); });
  std::size_t taken = 0;
  while (queue.try_enqueue("a", [] {})) ++taken;
  EXPECT_LE(taken, 5U);
  EXPECT_GE(taken, 3U);
  EXPECT_TRUE(queue.try_enqueue("b", [] {}));
  EXPECT_TRUE(queue.enqueue_rest("a", [] {}));
  go.set_value();
}

TEST(BoundedTaskQueue, WhoeverHoldsThreadsLeavesSomeForOthers) {
  std::promise<void> go;
  const std::shared_future<void> gone = go.get_future().share();
  std::atomic<int> held = 0;
  std::atomic<bool> ran = false;
  BoundedTaskQueue queue(4, 100);
  for (int n = 0; n < 10; ++n) {
    queue.try_enqueue("a", [&held, gone] {
      ++held;
      gone.wait();
    });
  }
  EXPECT_TRUE(queue.try_enqueue("b", [&] { ran = true; }));
  EXPECT_TRUE(test::eventually([&] { return ran.load(); }));
  EXPECT_TRUE(test::eventually([&] { return held == 2; }));
  go.set_value();
  queue.shutdown();
  EXPECT_EQ(held, 10);
}

TEST(BoundedTaskQueue, ItsThreadsAreAsNiceAsTheyAreToBe) {
  const auto niceness = [] { return ::getpriority(PRIO_PROCESS, 0); };
  const int mine = niceness();
  int nice = 0;
  int usual = 0;
  {
    BoundedTaskQueue background(1, 1, 1);
    BoundedTaskQueue queue(1, 1);
    background.try_enqueue("", [&] { nice = niceness(); });
    queue.try_enqueue("", [&] { usual = niceness(); });
  }
  EXPECT_EQ(nice, std::min(mine + 1, 19));
  EXPECT_EQ(usual, mine);
  EXPECT_EQ(niceness(), mine);
}

TEST(BoundedTaskQueue, EndsTwiceWithoutHarm) {
  BoundedTaskQueue queue(2, 2);
  queue.shutdown();
  queue.shutdown();
}

}  // namespace
}  // namespace isomesh::net
