#include "server/mesh/parallel.h"

#include <algorithm>
#include <atomic>
#include <mutex>
#include <stdexcept>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/kernels.h"

namespace isomesh::mesh {
namespace {

class ParallelFor : public testing::TestWithParam<int> {
 protected:
  test::ThreadCount threads{GetParam()};
};

TEST_P(ParallelFor, DoesEveryTaskOnce) {
  std::vector<std::atomic<int>> runs(1000);
  parallel_for({}, runs.size(), [&](std::size_t task) { ++runs[task]; });
  for (const auto& count : runs) EXPECT_EQ(count, 1);
}

TEST_P(ParallelFor, DoesNothingForNoTasks) {
  parallel_for({}, 0, [](std::size_t) { FAIL() << "there is no task"; });
}

TEST_P(ParallelFor, ThrowsOnWhatABodyThrows) {
  const auto body = [](std::size_t task) {
    if (task == 7) throw std::runtime_error("task 7");
  };
  EXPECT_THROW(parallel_for({}, 20, body), std::runtime_error);
}

TEST_P(ParallelFor, StartsNoTaskOnceItIsStopped) {
  std::stop_source source;
  source.request_stop();
  std::atomic<int> runs = 0;
  try {
    parallel_for({source.get_token(), {}}, 20, [&](std::size_t) { ++runs; });
    FAIL() << "it was not cancelled";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCancelled);
  }
  EXPECT_EQ(runs, 0);
}

TEST_P(ParallelFor, StopsBetweenTasks) {
  std::stop_source source;
  std::atomic<int> runs = 0;
  const auto body = [&](std::size_t) {
    ++runs;
    source.request_stop();
  };
  EXPECT_THROW(parallel_for({source.get_token(), {}}, 10000, body), Error);
  EXPECT_LE(runs, GetParam());
}

TEST_P(ParallelFor, ReportsProgressUpToOne) {
  std::mutex mutex;
  std::vector<double> reports;
  Context context;
  context.progress = [&](double share) {
    const std::lock_guard lock(mutex);
    reports.push_back(share);
  };
  parallel_for(context, 100, [](std::size_t) {});
  ASSERT_FALSE(reports.empty());
  EXPECT_GE(*std::min_element(reports.begin(), reports.end()), 0);
  EXPECT_DOUBLE_EQ(*std::max_element(reports.begin(), reports.end()), 1);
  if (GetParam() == 1) {
    EXPECT_TRUE(std::is_sorted(reports.begin(), reports.end()));
  }
}

INSTANTIATE_TEST_SUITE_P(Threads, ParallelFor, testing::Values(1, 2, 16));

TEST(SetThreadCount, IsWhatThreadCountTells) {
  const int before = thread_count();
  EXPECT_GE(before, 1);
  {
    const test::ThreadCount three(3);
    EXPECT_EQ(thread_count(), 3);
  }
  EXPECT_EQ(thread_count(), before);
}

TEST(OneThread, KeepsLoopsOnTheThreadThatBeginsThem) {
  {
    const OneThread alone;
    const std::thread::id here = std::this_thread::get_id();
    EXPECT_EQ(thread_count(), 1);
    std::size_t last = 0;
    parallel_for({}, 50, [&](std::size_t task) {
      EXPECT_EQ(std::this_thread::get_id(), here);
      EXPECT_GE(task, last);
      last = task;
    });
    EXPECT_EQ(last, 49U);
    EXPECT_THROW(parallel_for({}, 2, [](std::size_t) { throw std::runtime_error("x"); }),
                 std::runtime_error);
  }
  const int before = thread_count();
  set_thread_count(3);
  EXPECT_EQ(thread_count(), 3);
  set_thread_count(before);
}

TEST(OneThread, OutlivesOneWithinIt) {
  const test::ThreadCount three(3);
  {
    const OneThread alone;
    { const OneThread within; }
    EXPECT_EQ(thread_count(), 1);
  }
  EXPECT_EQ(thread_count(), 3);
}

TEST(Context, ThrowsOnlyWhenStopped) {
  std::stop_source source;
  const Context context{source.get_token(), {}};
  EXPECT_NO_THROW(context.throw_if_stopped());
  source.request_stop();
  EXPECT_THROW(context.throw_if_stopped(), Error);
  EXPECT_NO_THROW(Context{}.throw_if_stopped());
}

}  // namespace
}  // namespace isomesh::mesh
