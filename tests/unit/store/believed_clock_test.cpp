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
  EXPECT_FALSE(clock.is_doubted());
}

TEST_F(BelievedClockTest, GoesOnAtItsOwnPaceWhenTheClockIsSetAhead) {
  BelievedClock clock = clock_from(wall_);
  const Time before = clock.now();
  wall_ += days(40);
  EXPECT_EQ(clock.now(), before);
  EXPECT_TRUE(clock.is_doubted());
  pass(hours(3));
  EXPECT_EQ(clock.now(), before + hours(3));
  wall_ -= days(40);
  EXPECT_EQ(clock.now(), wall_);
  EXPECT_FALSE(clock.is_doubted());
}

TEST_F(BelievedClockTest, DoubtsAStartFarAhead) {
  BelievedClock clock = clock_from(wall_ - days(40));
  EXPECT_EQ(clock.now(), wall_ - days(40));
  EXPECT_TRUE(clock.is_doubted());
}

// And does not let what is stored then make it believe.
TEST_F(BelievedClockTest, FollowsAClockThatIsBehindAndDoubtsTheWayBack) {
  BelievedClock clock = clock_from(wall_);
  clock.now();
  wall_ -= days(40);
  EXPECT_EQ(clock.now(), wall_);
  wall_ += days(40);
  EXPECT_EQ(clock.now(), wall_ - days(40));
  EXPECT_TRUE(clock.is_doubted());
}

}  // namespace
}  // namespace isomesh::store
