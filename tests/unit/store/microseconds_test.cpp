#include "server/store/microseconds.h"

#include <cstdint>
#include <limits>

#include <gtest/gtest.h>

namespace isomesh::store {
namespace {

TEST(Microseconds, AreThoseOfATime) {
  for (const std::int64_t us :
       {std::int64_t{0}, std::int64_t{-1}, std::int64_t{1'790'000'000'123'456}}) {
    EXPECT_EQ(to_us(from_us(us)), us);
  }
  for (const Time time : {Time::min(), Time::max()}) {
    EXPECT_EQ(to_us(from_us(to_us(time))), to_us(time));
  }
}

TEST(Microseconds, BeyondTheClockAreTheFirstOrTheLastTime) {
  using Limits = std::numeric_limits<std::int64_t>;
  EXPECT_EQ(to_us(from_us(Limits::max())), to_us(Time::max()));
  EXPECT_EQ(to_us(from_us(Limits::min())), to_us(Time::min()));
}

}  // namespace
}  // namespace isomesh::store
