#include "base/throttle.h"

#include <atomic>
#include <chrono>
#include <cstdint>
#include <new>
#include <optional>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/process.h"

namespace isomesh {
namespace {

using testing::ElementsAre;
using testing::Pair;

constexpr std::chrono::hours kLong{1};

// Events with the number of the others.
class Told {
 public:
  Throttle<int>::Tell teller() {
    return [this](int event, std::uint64_t others) {
      const Lock lock(mutex_);
      if (is_away) return false;
      told_.emplace_back(event, others);
      return true;
    };
  }
  std::vector<std::pair<int, std::uint64_t>> all() {
    const Lock lock(mutex_);
    return told_;
  }

  std::atomic<bool> is_away = false;

 private:
  Mutex mutex_;
  std::vector<std::pair<int, std::uint64_t>> told_ ISOMESH_GUARDED_BY(mutex_);
};

TEST(Throttle, TellsTheFirstAtOnceAndTheOthersAtTheEnd) {
  Told told;
  {
    Throttle<int> throttle(kLong, told.teller());
    for (int n = 1; n <= 724; ++n) throttle.add(n);
    EXPECT_THAT(told.all(), ElementsAre(Pair(1, 0)));
  }
  EXPECT_THAT(told.all(), ElementsAre(Pair(1, 0), Pair(724, 722)));
}

TEST(Throttle, TellsTheOthersAfterThePauseThoughNoneFollows) {
  Told told;
  Throttle<int> throttle(std::chrono::milliseconds(50), told.teller());
  std::uint64_t added = 0;
  // A busy machine may need longer than the pause for them.
  for (; added < 5 || told.all().empty(); ++added) throttle.add(static_cast<int>(added));
  const auto count = [&] {
    std::uint64_t sum = 0;
    for (const auto& [event, others] : told.all()) sum += 1 + others;
    return sum;
  };
  EXPECT_TRUE(test::eventually([&] { return count() == added; }));
}

TEST(Throttle, LosesNoneThatCannotBeToldAtOnce) {
  Told told;
  told.is_away = true;
  {
    Throttle<int> throttle(kLong, told.teller());
    throttle.add(1);
    throttle.add(2);
    EXPECT_THAT(told.all(), ElementsAre());
    told.is_away = false;
  }
  EXPECT_THAT(told.all(), ElementsAre(Pair(2, 1)));
}

TEST(Throttle, EndsWithTheNumberThatCouldNotBeTold) {
  Told told;
  told.is_away = true;
  Throttle<int> throttle(kLong, told.teller());
  for (int n = 1; n <= 3; ++n) throttle.add(n);
  EXPECT_EQ(throttle.end(), 3U);
  told.is_away = false;
  EXPECT_EQ(throttle.end(), 0U);
  EXPECT_THAT(told.all(), ElementsAre(Pair(3, 2)));
}

// Also not by its own thread, which would end the program.
TEST(Throttle, LosesNoneThatThrows) {
  Told told;
  std::atomic<int> failures = 2;
  {
    Throttle<int> throttle(std::chrono::milliseconds(20),
                           [&, tell = told.teller()](int event, std::uint64_t others) {
                             if (failures-- > 0) throw std::bad_alloc();
                             return tell(event, others);
                           });
    throttle.add(1);
    EXPECT_TRUE(test::eventually([&] { return !told.all().empty(); }));
  }
  EXPECT_THAT(told.all(), ElementsAre(Pair(1, 0)));
}

}  // namespace
}  // namespace isomesh
