#include "server/net/fair_places.h"

#include <atomic>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "proto/error.h"

namespace isomesh::net {
namespace {

// The refusal; nothing when there was a place, which is held.
std::optional<ErrorCode> take(FairPlaces& places, const std::string& party,
                              std::vector<FairPlaces::Place>& held) {
  try {
    held.push_back(places.take(party));
    return std::nullopt;
  } catch (const Error& error) {
    return error.code();
  }
}

std::size_t take_all(FairPlaces& places, const std::string& party,
                     std::vector<FairPlaces::Place>& held) {
  const std::size_t before = held.size();
  while (!take(places, party, held)) {
  }
  return held.size() - before;
}

TEST(FairPlaces, GivesAsManyAsThereAre) {
  FairPlaces places(2, "things");
  std::vector<FairPlaces::Place> held;
  EXPECT_EQ(take_all(places, "", held), 2);
  EXPECT_EQ(places.taken(), 2);
  EXPECT_EQ(take(places, "", held), ErrorCode::kUnavailable);
  EXPECT_EQ(take(places, "a", held), ErrorCode::kUnavailable);
  held.pop_back();
  EXPECT_FALSE(take(places, "a", held));
}

TEST(FairPlaces, OnePartyLeavesAsManyAsItTakes) {
  FairPlaces places(16, "things");
  std::vector<FairPlaces::Place> held;
  EXPECT_EQ(take_all(places, "a", held), 8);
  EXPECT_EQ(take(places, "a", held), ErrorCode::kTooManyRequests);
  EXPECT_FALSE(take(places, "b", held));
}

TEST(FairPlaces, SeveralGreedyOnesLeaveAShare) {
  FairPlaces places(1000, "things");
  std::vector<FairPlaces::Place> held;
  for (const std::string party : {"a", "b", "c"}) take_all(places, party, held);
  EXPECT_GE(take_all(places, "d", held), 60);
}

TEST(FairPlaces, TheOnlyPlaceIsForWhoeverComes) {
  FairPlaces places(1, "things");
  std::vector<FairPlaces::Place> held;
  EXPECT_FALSE(take(places, "a", held));
  EXPECT_EQ(take(places, "a", held), ErrorCode::kUnavailable);
}

TEST(FairPlaces, AMovedPlaceIsGivenBackOnce) {
  FairPlaces places(2, "things");
  FairPlaces::Place kept = places.take("a");
  {
    FairPlaces::Place place = places.take("");
    FairPlaces::Place moved = std::move(place);
    EXPECT_EQ(places.taken(), 2);
    moved = FairPlaces::Place();
    EXPECT_EQ(places.taken(), 1);
  }
  EXPECT_EQ(places.taken(), 1);
}

TEST(FairPlaces, NeverGivesMoreThanThereAre) {
  constexpr int kPlaces = 3;
  FairPlaces places(kPlaces, "things");
  std::atomic<int> held = 0;
  std::atomic<bool> exceeded = false;
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < 8; ++thread) {
    threads.emplace_back([&] {
      std::vector<FairPlaces::Place> mine;
      for (int n = 0; n < 2000; ++n) {
        if (take(places, "", mine)) continue;
        if (++held > kPlaces) exceeded = true;
        --held;
        mine.clear();
      }
    });
  }
  threads.clear();
  EXPECT_FALSE(exceeded);
  EXPECT_EQ(places.taken(), 0);
}

}  // namespace
}  // namespace isomesh::net
