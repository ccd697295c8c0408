#include "server/store/health_check.h"

#include <chrono>

#include <gtest/gtest.h>

#include "tests/support/errors.h"

namespace isomesh::store {
namespace {

using std::chrono::hours;
using std::chrono::milliseconds;

TEST(HealthCheck, ACheckThatThrowsHasFailedAndEnded) {
  HealthCheck health;
  const auto throws = []() -> bool { throw Error(ErrorCode::kInternal, "it cannot be checked"); };
  EXPECT_EQ(test::code_thrown_by([&] { health.passes(throws, milliseconds(0), hours(1)); }),
            ErrorCode::kInternal);
  const auto is_well = [] { return true; };
  EXPECT_FALSE(health.passes(is_well, hours(1), hours(1)));
  EXPECT_TRUE(health.passes(is_well, milliseconds(0), hours(1)));
}

}  // namespace
}  // namespace isomesh::store
