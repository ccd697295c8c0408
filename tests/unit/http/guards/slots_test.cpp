#include "server/http/guards/slots.h"

#include <atomic>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

namespace isomesh::http {
namespace {

TEST(Slots, GivesAsManyPlacesAsThereAre) {
  Slots slots(2);
  const auto first = slots.try_take();
  auto second = slots.try_take();
  EXPECT_TRUE(first && second);
  EXPECT_FALSE(slots.try_take());
  EXPECT_FALSE(slots.try_take());
  second.reset();
  EXPECT_TRUE(slots.try_take());
}

TEST(Slots, WithoutPlacesGiveNone) {
  Slots slots(0);
  EXPECT_FALSE(slots.try_take());
}

TEST(Slots, AMovedPlaceIsGivenBackOnce) {
  Slots slots(1);
  {
    auto place = slots.try_take();
    const Slots::Place moved = std::move(*place);
    place.reset();
    EXPECT_FALSE(slots.try_take());
  }
  const auto again = slots.try_take();
  EXPECT_TRUE(again);
  EXPECT_FALSE(slots.try_take());
}

TEST(Slots, NeverGiveMoreThanThereAre) {
  constexpr int kPlaces = 3;
  Slots slots(kPlaces);
  std::atomic<int> held = 0;
  std::atomic<bool> exceeded = false;
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < 8; ++thread) {
    threads.emplace_back([&] {
      for (int n = 0; n < 2000; ++n) {
        const auto place = slots.try_take();
        if (!place) continue;
        if (++held > kPlaces) exceeded = true;
        --held;
      }
    });
  }
  threads.clear();
  EXPECT_FALSE(exceeded);
  std::vector<std::optional<Slots::Place>> all;
  for (int n = 0; n < kPlaces; ++n) EXPECT_TRUE(all.emplace_back(slots.try_take()));
  EXPECT_FALSE(slots.try_take());
}

}  // namespace
}  // namespace isomesh::http
