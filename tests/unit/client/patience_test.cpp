// When a large upload is given up.
#include "client/isomesh/patience.h"

#include <gtest/gtest.h>

namespace isomesh {
namespace {

using std::chrono::seconds;

class PatienceTest : public testing::Test {
 protected:
  void pass(seconds time) { now_ += time; }

  Patience::Clock::time_point now_;
  Patience patience_{[this] { return now_; }};
};

TEST_F(PatienceTest, EndsAMinuteAfterTheFirstFailure) {
  pass(seconds{1000});
  EXPECT_FALSE(patience_.is_over());
  patience_.fail();
  pass(seconds{30});
  patience_.fail();
  patience_.hear(0);
  EXPECT_FALSE(patience_.is_over());
  pass(seconds{30});
  EXPECT_TRUE(patience_.is_over());
}

// Both parts broke, and the second after more than a minute in which it got on.
TEST_F(PatienceTest, BeginsAnewIfTheServerHasMore) {
  patience_.fail();
  patience_.hear(0);
  pass(seconds{90});
  patience_.fail();
  patience_.hear(1'000'000);
  EXPECT_FALSE(patience_.is_over());
  patience_.fail();
  patience_.hear(1'000'000);
  pass(seconds{60});
  EXPECT_TRUE(patience_.is_over());
}

// The server was there, and asked for the time.
TEST_F(PatienceTest, DoesNotCountTheTimeThatABusyServerAskedFor) {
  patience_.excuse(seconds{100});
  patience_.fail();
  pass(seconds{59});
  patience_.excuse(seconds{300});
  pass(seconds{300});
  EXPECT_FALSE(patience_.is_over());
  pass(seconds{1});
  EXPECT_TRUE(patience_.is_over());
}

TEST_F(PatienceTest, PausesGrowUntilTheServerHasMore) {
  const auto first = patience_.next_pause();
  for (int n = 0; n < 20; ++n) patience_.next_pause();
  EXPECT_GT(patience_.next_pause(), first);
  EXPECT_LT(patience_.next_pause(), seconds{10});
  patience_.hear(1);
  EXPECT_EQ(patience_.next_pause(), first);
}

}  // namespace
}  // namespace isomesh
