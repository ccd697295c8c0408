#include "server/jobs/library/cache.h"

#include <atomic>
#include <latch>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/errors.h"

namespace isomesh::jobs {
namespace {

// A key that can be copied only so often, as where memory ends.
class ScarceKey {
 public:
  explicit ScarceKey(int* copies) : copies_(copies) {}
  ScarceKey(const ScarceKey& other) : copies_(other.copies_) {
    if (*copies_ == 0) throw std::bad_alloc();
    --*copies_;
  }
  ScarceKey& operator=(const ScarceKey&) = delete;
  ~ScarceKey() = default;
  friend bool operator<(const ScarceKey& /*one*/, const ScarceKey& /*equal*/) { return false; }

 private:
  int* copies_;
};

TEST(Cache, ComputesAValueOnce) {
  Cache<int, std::string> cache(2, 4);
  int found = 0;
  const auto find = [&] { return std::to_string(++found); };
  EXPECT_EQ(*cache.get(7, find), "1");
  EXPECT_EQ(*cache.get(7, find), "1");
  EXPECT_EQ(*cache.get(8, find), "2");
}

TEST(Cache, ForgetsTheOneThatWasAskedForLongestAgo) {
  Cache<int, int> cache(2, 4);
  int found = 0;
  const auto find = [&] { return ++found; };
  cache.get(1, find);
  cache.get(2, find);
  cache.get(1, find);
  cache.get(3, find);
  EXPECT_EQ(*cache.get(1, find), 1);
  EXPECT_EQ(*cache.get(2, find), 4);
}

TEST(Cache, AFailureIsNotKept) {
  Cache<int, int> cache(2, 1);
  EXPECT_EQ(test::code_thrown_by([&] {
              cache.get(1, []() -> int { throw Error(ErrorCode::kOutOfSpace, "no room"); });
            }),
            ErrorCode::kOutOfSpace);
  EXPECT_EQ(*cache.get(1, [] { return 5; }), 5);
}

TEST(Cache, ACallerThatGetsNoMemoryWaitsNoLonger) {
  Cache<ScarceKey, int> cache(1, 1);
  int failed = 0;
  for (;;) {
    int copies = failed;
    try {
      EXPECT_EQ(*cache.get(ScarceKey(&copies), [] { return 5; }), 5);
      break;
    } catch (const std::bad_alloc&) {
      ++failed;
    }
  }
  EXPECT_GT(failed, 0);
  int none = 0;
  EXPECT_EQ(*cache.get(ScarceKey(&none), [] { return 0; }), 5);
}

TEST(Cache, SeveralWaitForOneFinder) {
  constexpr int kCallers = 6;
  Cache<int, int> cache(2, kCallers);
  std::atomic<int> found = 0;
  std::latch all_there(kCallers);
  std::atomic<int> right = 0;
  std::vector<std::jthread> callers;
  for (int caller = 0; caller < kCallers; ++caller) {
    callers.emplace_back([&] {
      all_there.arrive_and_wait();
      right += *cache.get(1, [&] { return ++found; }) == 1 ? 1 : 0;
    });
  }
  callers.clear();
  EXPECT_EQ(found, 1);
  EXPECT_EQ(right, kCallers);
}

TEST(Cache, TooManyWaitersAreSentAway) {
  Cache<int, int> cache(4, 1);
  cache.get(9, [] { return 9; });
  std::latch began(1);
  std::latch may_end(1);
  std::jthread slow([&] {
    cache.get(1, [&] {
      began.count_down();
      may_end.wait();
      return 1;
    });
  });
  began.wait();
  for (const int key : {1, 2}) {
    EXPECT_EQ(test::code_thrown_by([&] { cache.get(key, [] { return 0; }); }),
              ErrorCode::kUnavailable);
  }
  EXPECT_EQ(*cache.get(9, [] { return 0; }), 9);  // what is there needs no waiting
  may_end.count_down();
  slow.join();
  EXPECT_EQ(*cache.get(2, [] { return 2; }), 2);
}

}  // namespace
}  // namespace isomesh::jobs
