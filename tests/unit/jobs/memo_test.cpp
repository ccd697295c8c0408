#include "server/jobs/library/memo.h"

#include <atomic>
#include <latch>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/errors.h"

namespace isomesh::jobs {
namespace {

TEST(Memo, FindsAnAnswerOnce) {
  Memo<int, std::string> memo(2, 4);
  int found = 0;
  const auto find = [&] { return std::to_string(++found); };
  EXPECT_EQ(*memo.get(7, find), "1");
  EXPECT_EQ(*memo.get(7, find), "1");
  EXPECT_EQ(*memo.get(8, find), "2");
}

TEST(Memo, ForgetsTheOneThatWasAskedForLongestAgo) {
  Memo<int, int> memo(2, 4);
  int found = 0;
  const auto find = [&] { return ++found; };
  memo.get(1, find);
  memo.get(2, find);
  memo.get(1, find);
  memo.get(3, find);
  EXPECT_EQ(*memo.get(1, find), 1);
  EXPECT_EQ(*memo.get(2, find), 4);
}

TEST(Memo, AFailureIsNotKept) {
  Memo<int, int> memo(2, 1);
  EXPECT_EQ(test::code_thrown_by([&] {
              memo.get(1, []() -> int { throw Error(ErrorCode::kOutOfSpace, "no room"); });
            }),
            ErrorCode::kOutOfSpace);
  EXPECT_EQ(*memo.get(1, [] { return 5; }), 5);
}

TEST(Memo, SeveralWaitForOneFinder) {
  constexpr int kCallers = 6;
  Memo<int, int> memo(2, kCallers);
  std::atomic<int> found = 0;
  std::latch all_there(kCallers);
  std::atomic<int> right = 0;
  std::vector<std::jthread> callers;
  for (int caller = 0; caller < kCallers; ++caller) {
    callers.emplace_back([&] {
      all_there.arrive_and_wait();
      right += *memo.get(1, [&] { return ++found; }) == 1 ? 1 : 0;
    });
  }
  callers.clear();
  EXPECT_EQ(found, 1);
  EXPECT_EQ(right, kCallers);
}

TEST(Memo, TooManyWaitersAreSentAway) {
  Memo<int, int> memo(4, 1);
  memo.get(9, [] { return 9; });
  std::latch began(1);
  std::latch may_end(1);
  std::jthread slow([&] {
    memo.get(1, [&] {
      began.count_down();
      may_end.wait();
      return 1;
    });
  });
  began.wait();
  for (const int key : {1, 2}) {
    EXPECT_EQ(test::code_thrown_by([&] { memo.get(key, [] { return 0; }); }),
              ErrorCode::kUnavailable);
  }
  EXPECT_EQ(*memo.get(9, [] { return 0; }), 9);  // what is there needs no waiting
  may_end.count_down();
  slow.join();
  EXPECT_EQ(*memo.get(2, [] { return 2; }), 2);
}

}  // namespace
}  // namespace isomesh::jobs
