#include "base/ids.h"

#include <algorithm>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/clock.h"

namespace isomesh {
namespace {

TEST(RandomHex, HasItsLengthAndIsNeverTheSame) {
  std::set<std::string> seen;
  for (int n = 0; n < 1000; ++n) {
    const std::string text = random_hex(8);
    EXPECT_EQ(text.size(), 16U);
    EXPECT_EQ(text.find_first_not_of("0123456789abcdef"), std::string::npos);
    EXPECT_TRUE(seen.insert(text).second);
  }
}

TEST(TimeOrderedId, IsAUuidOfVersion7) {
  const auto is_uuid =
      testing::MatchesRegex("[0-9a-f]{8}-[0-9a-f]{4}-7[0-9a-f]{3}-[89ab][0-9a-f]{3}-[0-9a-f]{12}");
  for (int n = 0; n < 100; ++n) EXPECT_THAT(time_ordered_id(), is_uuid);
}

TEST(TimeOrderedId, IsNeverTheSameAlsoFromThreads) {
  std::mutex mutex;
  std::set<std::string> seen;
  {
    std::vector<std::jthread> threads;
    for (int thread = 0; thread < 4; ++thread) {
      threads.emplace_back([&] {
        for (int n = 0; n < 500; ++n) {
          const std::string id = time_ordered_id();
          const std::lock_guard lock(mutex);
          seen.insert(id);
        }
      });
    }
  }
  EXPECT_EQ(seen.size(), 2000U);
}

// The order in which jobs are listed and pages continue.
TEST(TimeOrderedId, SortsByTheTimeThatItWasMade) {
  std::vector<std::string> ids;
  for (int n = 0; n < 1000; ++n) ids.push_back(time_ordered_id());
  EXPECT_TRUE(std::ranges::is_sorted(ids));
}

TEST(Timestamp, IsRfc3339InUtcWithMilliseconds) {
  const auto is_timestamp =
      testing::MatchesRegex("20[0-9]{2}-[0-9]{2}-[0-9]{2}T[0-9]{2}:[0-9]{2}:[0-9]{2}\\.[0-9]{3}Z");
  std::vector<std::string> stamps;
  for (int n = 0; n < 100; ++n) {
    stamps.push_back(timestamp());
    EXPECT_THAT(stamps.back(), is_timestamp);
  }
  EXPECT_TRUE(std::ranges::is_sorted(stamps));
}

// The example of RFC 9110, 5.6.7.
TEST(HttpDate, IsAsInTheStandard) {
  for (const char* wrong : {"3024-01-01T00:00:00.000Z", "1969-12-31T23:59:59.999Z", "yesterday",
                            "2262-01-01T00:00:00.000Z", "2024-2147483647-01T00:00:00.000Z"}) {
    EXPECT_EQ(time_of(wrong), std::chrono::system_clock::time_point()) << wrong;
  }
  EXPECT_EQ(timestamp_of(time_of("2261-12-31T23:59:59.999Z")), "2261-12-31T23:59:59.999Z");
  EXPECT_EQ(http_date_of(time_of("1994-11-06T08:49:37.999Z")), "Sun, 06 Nov 1994 08:49:37 GMT");
}

}  // namespace
}  // namespace isomesh
