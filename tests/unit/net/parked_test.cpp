#include "server/net/parked.h"

#include <atomic>

#include <gtest/gtest.h>

#include "tests/support/process.h"

namespace isomesh::net {
namespace {

using Clock = std::chrono::steady_clock;

class ParkedTest : public testing::Test {
 protected:
  void park(const std::string& job, Clock::duration wait = std::chrono::hours(1)) {
    parked_.park({job, Clock::now() + wait, [this] { ++resumed_; }});
  }

  std::atomic<int> resumed_ = 0;
  std::atomic<bool> ended_ = false;
  Parked parked_{[this](const std::string&) { return ended_.load(); }};
};

TEST_F(ParkedTest, ResumesThoseWhoseJobHasEnded) {
  park("a");
  park("b");
  park("a");
  EXPECT_EQ(resumed_, 0);
  parked_.job_ended("a");
  EXPECT_EQ(resumed_, 2);
  parked_.job_ended("a");
  EXPECT_EQ(resumed_, 2);
}

TEST_F(ParkedTest, ResumesThoseWhoseTimeIsOver) {
  park("a");
  park("a", std::chrono::milliseconds(20));
  park("a", std::chrono::milliseconds(10));
  EXPECT_TRUE(test::eventually([&] { return resumed_ == 2; }));
}

TEST_F(ParkedTest, AJobThatHasEndedIsNotWaitedFor) {
  ended_ = true;
  park("a");
  EXPECT_EQ(resumed_, 1);
}

TEST_F(ParkedTest, OneTooManyIsResumedAtOnce) {
  for (std::size_t n = 0; n < Parked::kMostRequests; ++n) park("a");
  EXPECT_EQ(resumed_, 0);
  park("a");
  EXPECT_EQ(resumed_, 1);
}

TEST_F(ParkedTest, ClosingResumesAll) {
  park("a");
  park("b");
  parked_.close();
  EXPECT_EQ(resumed_, 2);
  park("c");
  EXPECT_EQ(resumed_, 3);
}

}  // namespace
}  // namespace isomesh::net
