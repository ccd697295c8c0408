#include "server/net/parked.h"

#include <array>
#include <atomic>

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
  Descriptor ours_;
  Descriptor theirs_;
  // Declared last: its thread may look at all of them until it has ended.
  Parked parked_{[](const std::string&) { return false; }};
};

// One that was resumed before its time would ask again at once.
TEST_F(ParkedTest, ThereIsRoomForAsManyAsConnect) {
  for (int n = 0; n < 3000; ++n) park("a");
  EXPECT_EQ(resumed_, 0);
  parked_.job_ended("a");
  EXPECT_EQ(resumed_, 3000);
}

TEST_F(ParkedTest, MoreThatIsSentIsNoEnd) {
  std::array<int, 2> ends = {};
  ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM, 0, ends.data()), 0);
  ours_ = Descriptor(ends[0]);
  theirs_ = Descriptor(ends[1]);
  parked_.park({.job = "a",
                .until = Clock::now() + std::chrono::hours(1),
                .resume = [this] { ++resumed_; },
                .descriptor = ours_.number(),
                .abandoned = [this] { ++told_; }});
  ASSERT_EQ(::send(theirs_.number(), "more", 4, 0), 4);
  park("b", std::chrono::milliseconds(20));
  EXPECT_TRUE(test::eventually([&] { return resumed_ == 1; }));
  EXPECT_EQ(told_, 0);
}

}  // namespace
}  // namespace isomesh::net
