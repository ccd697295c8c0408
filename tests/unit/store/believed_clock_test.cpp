#include "server/store/believed_clock.h"

#include <gtest/gtest.h>

namespace isomesh::store {
namespace {

using std::chrono::days;
using std::chrono::hours;

class BelievedClockTest : public testing::Test {
 protected:
  BelievedClock clock_from(Time last_seen) {
    return {last_seen,
            {.tolerance = days(1),
             .wall = [this] { return wall_; },
             .steady = [this] { return steady_; }}};
  }

  void pass(std::chrono::milliseconds time) {
    wall_ += time;
    steady_ += time;
  }

  Time wall_{days(20'000)};
  BelievedClock::Steady steady_{hours(5)};
};

TEST_F(BelievedClockTest, FollowsAClockThatIsRight) {
  BelievedClock clock = clock_from(wall_ - hours(2));
  EXPECT_EQ(clock.now(), wall_);
  pass(days(400));
  EXPECT_EQ(clock.now(), wall_);
  EXPECT_EQ(clock.doubt(), BelievedClock::Doubt::kNone);
}

TEST_F(BelievedClockTest, GoesOnAtItsOwnPaceWhenTheClockIsSetAhead) {
  BelievedClock clock = clock_from(wall_);
  const Time before = clock.now();
  wall_ += days(40);
  EXPECT_EQ(clock.now(), before);
  EXPECT_EQ(clock.doubt(), BelievedClock::Doubt::kAhead);
  pass(hours(3));
  EXPECT_EQ(clock.now(), before + hours(3));
  wall_ -= days(40);
  EXPECT_EQ(clock.now(), wall_);
  EXPECT_EQ(clock.doubt(), BelievedClock::Doubt::kNone);
}

TEST_F(BelievedClockTest, DoubtsAStartFarAhead) {
  BelievedClock clock = clock_from(wall_ - days(40));
  EXPECT_EQ(clock.now(), wall_ - days(40));
  EXPECT_EQ(clock.doubt(), BelievedClock::Doubt::kAhead);
}

// If its time went back, data used meanwhile would seem the oldest of all once the clock is right.
TEST_F(BelievedClockTest, NeverGoesBack) {
  BelievedClock clock = clock_from(wall_);
  const Time before = clock.now();
  wall_ -= days(40);
  EXPECT_EQ(clock.now(), before);
  EXPECT_EQ(clock.doubt(), BelievedClock::Doubt::kBehind);
  pass(days(3));
  EXPECT_EQ(clock.now(), before + days(3));
  wall_ += days(40);
  EXPECT_EQ(clock.now(), wall_);
  EXPECT_EQ(clock.doubt(), BelievedClock::Doubt::kNone);
}

TEST_F(BelievedClockTest, AStartFarBehindGoesOnFromWhatWasSeen) {
  const Time seen = wall_ + days(40);
  BelievedClock clock = clock_from(seen);
  EXPECT_EQ(clock.now(), seen);
  EXPECT_EQ(clock.doubt(), BelievedClock::Doubt::kBehind);
}

TEST_F(BelievedClockTest, AClockThatIsALittleBehindIsNoMatter) {
  BelievedClock clock = clock_from(wall_);
  const Time before = clock.now();
  wall_ -= hours(3);
  EXPECT_EQ(clock.now(), before);
  EXPECT_EQ(clock.doubt(), BelievedClock::Doubt::kNone);
}

}  // namespace
}  // namespace isomesh::store
