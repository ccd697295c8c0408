// Whose job every engine starts next: owners take turns by what their runs are expected to take.
#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>

#include "tests/unit/store/engine.h"

namespace isomesh::store {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;

class TurnConformance : public test::EngineTest {
 protected:
  static constexpr std::array<const char*, 4> kOwners = {"a", "b", "c", "d"};
  static constexpr double kMsPerPass = 10;

  // A run takes as long as the parameters say.
  TurnConformance() {
    make({.expected_ms = [](const Volume&, const JobParameters& parameters) {
      return kMsPerPass * parameters.passes;
    }});
    for (const char* owner : kOwners) add_volume(owner, kVolume);
  }

  std::string submit_one(const std::string& owner, int cost = 1,
                         Priority priority = Priority::kRoutine) {
    JobParameters parameters = unlike(priority);
    parameters.passes = cost;
    return submit(parameters, owner).id;
  }
  void submit_many(const std::string& owner, int count, int cost = 1) {
    for (int n = 0; n < count; ++n) submit_one(owner, cost);
  }

  // Whose the next jobs are, which do not end.
  std::string claim_many(int count) {
    std::string owners;
    for (int n = 0; n < count; ++n) owners += claimed().owner;
    return owners;
  }
};

INSTANTIATE_TEST_SUITE_P(Engines, TurnConformance, testing::ValuesIn(test::all_engines()),
                         test::name_of);

TEST_P(TurnConformance, AnOwnersFirstJobStartsNextHoweverManyWaitOfAnother) {
  submit_many("a", 20);
  EXPECT_EQ(claim_many(3), "aaa");
  submit_one("b");
  EXPECT_EQ(claim_many(2), "ba");
}

TEST_P(TurnConformance, AnOwnersJobsStartByAge) {
  const std::string first = submit_one("a");
  const std::string second = submit_one("a");
  const std::string other = submit_one("b");
  std::vector<std::string> order;
  for (int n = 0; n < 3; ++n) order.push_back(claimed().id);
  EXPECT_THAT(order, ElementsAre(first, other, second));
}

TEST_P(TurnConformance, TurnsAreByWhatTheRunsTake) {
  submit_many("a", 3, 30);
  submit_many("b", 9, 10);
  EXPECT_EQ(claim_many(12), "abbbabbbabbb");
}

TEST_P(TurnConformance, WhoWasIdleHasSavedNothingUp) {
  submit_many("a", 40);
  claim_many(20);
  submit_many("b", 5);
  const std::string order = claim_many(10);
  EXPECT_EQ(std::ranges::count(order.substr(0, 4), 'b'), 2) << order;
  EXPECT_EQ(std::ranges::count(order, 'b'), 5) << order;
}

TEST_P(TurnConformance, WhoseJobsCouldNotRunHasSavedNothingUp) {
  submit_many("b", 3);
  EXPECT_TRUE(jobs().put_back(claimed(), kLong));
  jobs().cancel("b", jobs().list("b", {.state = JobState::kQueued}, "", 1).at(0).id);
  EXPECT_EQ(claimed().owner, "b");
  submit_many("a", 20);
  EXPECT_EQ(claim_many(10), "aaaaaaaaaa");
  submit_many("b", 4);
  const std::string order = claim_many(8);
  EXPECT_EQ(std::ranges::count(order, 'b'), 4) << order;
  EXPECT_LE(std::ranges::count(order.substr(0, 4), 'b'), 3) << order;
}

TEST_P(TurnConformance, NobodyIsOwedAnythingWhileNobodyWaits) {
  submit_one("a", 50);
  EXPECT_EQ(claim_many(1), "a");
  EXPECT_FALSE(jobs().claim("worker", kLongLease));
  submit_many("a", 2);
  submit_many("b", 2);
  EXPECT_EQ(claim_many(4), "abab");
}

TEST_P(TurnConformance, PrioritiesComeFirstAndHaveTurnsOfTheirOwn) {
  submit_many("a", 4);
  submit_many("b", 4);
  EXPECT_EQ(claim_many(2), "ab");
  for (int n = 0; n < 3; ++n) submit_one("b", 50, Priority::kStat);
  submit_one("a", 50, Priority::kStat);
  EXPECT_EQ(claim_many(4), "babb");
  EXPECT_EQ(claim_many(4), "abab");
}

TEST_P(TurnConformance, CancelledJobsTakeNoTurn) {
  submit_many("a", 20);
  for (const Job& job : jobs().list("a", {.state = JobState::kQueued}, "", 20))
    jobs().cancel("a", job.id);
  submit_many("a", 2);
  submit_many("b", 2);
  EXPECT_EQ(claim_many(4), "abab");
}

TEST_P(TurnConformance, TurnsOutliveTheProcess) {
  submit_many("a", 4, 3);
  submit_many("b", 12);
  EXPECT_EQ(claim_many(2), "ab");
  restart();
  EXPECT_EQ(claim_many(2), "bb");
}

// Goyal, Vin and Cheng, theorem 1: while both have jobs that wait, one gets ahead of the other by
// the largest job of each at most, over any interval.
TEST_P(TurnConformance, NoOwnerWithWaitingJobsLagsByMoreThanALargestJobOfEach) {
  constexpr int kSteps = 600;
  std::mt19937 random(7);
  const auto below = [&](std::uint32_t bound) { return static_cast<int>(random() % bound); };
  const auto largest = [](const std::string& owner) { return owner == "a" ? 100 : 10; };
  std::map<std::string, int> waiting;
  std::map<std::string, int> served;
  // For each pair of owners: how far one was ahead of the other since both have waiting jobs.
  struct Lead {
    bool is_open = false;
    int least = 0;
    int most = 0;
  };
  std::map<std::pair<std::string, std::string>, Lead> leads;
  const auto look = [&](bool after_claim) {
    for (const std::string one : kOwners) {
      for (const std::string other : kOwners) {
        Lead& lead = leads[{one, other}];
        const int now = served[one] - served[other];
        if (lead.is_open && after_claim) {
          lead.least = std::min(lead.least, now);
          lead.most = std::max(lead.most, now);
          ASSERT_LE(lead.most - lead.least, largest(one) + largest(other));
        }
        const bool both_wait = waiting[one] > 0 && waiting[other] > 0;
        if (both_wait && !lead.is_open) lead = {true, now, now};
        lead.is_open = both_wait;
      }
    }
  };
  for (int step = 0; step < kSteps; ++step) {
    // Floods and droughts: sometimes all owners are idle, sometimes one has many jobs.
    const bool submits = below(100) < (step / 100 % 2 == 0 ? 70 : 35);
    if (submits) {
      const std::string owner = kOwners.at(static_cast<std::size_t>(below(kOwners.size())));
      const auto most = static_cast<std::uint32_t>(largest(owner));
      for (int n = below(4); n >= 0; --n, ++waiting[owner]) submit_one(owner, 1 + below(most));
    } else if (const auto lease = jobs().claim("worker", kLongLease)) {
      --waiting[lease->owner];
      served[lease->owner] += lease->parameters.passes;
      if (below(2) == 0) jobs().finish(*lease, failure());
    }
    look(!submits);
    if (HasFatalFailure()) return;
  }
  for (const char* owner : kOwners) EXPECT_GT(served[owner], 0);
}

}  // namespace
}  // namespace isomesh::store
