#include "server/net/parked.h"

#include <array>
#include <atomic>
#include <functional>

#include <gtest/gtest.h>
#include <sys/socket.h>

#include "base/descriptor.h"
#include "tests/support/process.h"

namespace isomesh::net {
namespace {

using Clock = std::chrono::steady_clock;

class ParkedTest : public testing::Test {
 protected:
  void park(const std::string& job, Clock::duration wait = std::chrono::hours(1)) {
    parked_.park({.job = job, .until = Clock::now() + wait, .resume = [this] { ++resumed_; }});
  }

  std::atomic<int> resumed_ = 0;
  std::atomic<int> told_ = 0;
  std::atomic<bool> ended_ = false;
  Descriptor ours_;
  Descriptor theirs_;
  // Declared last: its thread may look at all of them until it has ended.
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

// One that was resumed before its time would ask again at once.
TEST_F(ParkedTest, ThereIsRoomForAsManyAsConnect) {
  for (int n = 0; n < 3000; ++n) park("a");
  EXPECT_EQ(resumed_, 0);
  parked_.job_ended("a");
  EXPECT_EQ(resumed_, 3000);
}

// Two ends of a connection; the second is the client's.
class WatchedTest : public ParkedTest {
 protected:
  WatchedTest() {
    std::array<int, 2> ends = {};
    if (::socketpair(AF_UNIX, SOCK_STREAM, 0, ends.data()) == 0) {
      ours_ = Descriptor(ends[0]);
      theirs_ = Descriptor(ends[1]);
    }
  }

  void park_watched(const std::function<void()>& abandoned) {
    parked_.park({.job = "a",
                  .until = Clock::now() + std::chrono::hours(1),
                  .resume = [this] { ++resumed_; },
                  .descriptor = ours_.number(),
                  .abandoned = abandoned});
  }
};

TEST_F(WatchedTest, ANoticedEndIsToldOnceAndTheRequestWaitsOn) {
  park_watched([this] { ++told_; });
  theirs_ = Descriptor();
  EXPECT_TRUE(test::eventually([&] { return told_ == 1; }));
  EXPECT_EQ(resumed_, 0);
  parked_.job_ended("a");
  EXPECT_EQ(resumed_, 1);
  EXPECT_EQ(told_, 1);
}

TEST_F(WatchedTest, WhoeverHasNothingToDoAtTheEndGoesOn) {
  park_watched(nullptr);
  EXPECT_EQ(resumed_, 0);
  theirs_ = Descriptor();
  EXPECT_TRUE(test::eventually([&] { return resumed_ == 1; }));
}

TEST_F(WatchedTest, MoreThatIsSentIsNoEnd) {
  park_watched([this] { ++told_; });
  ASSERT_EQ(::send(theirs_.number(), "more", 4, 0), 4);
  park("b", std::chrono::milliseconds(20));
  EXPECT_TRUE(test::eventually([&] { return resumed_ == 1; }));
  EXPECT_EQ(told_, 0);
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
