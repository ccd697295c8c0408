// Tests of concurrent threads on every engine.
#include <algorithm>
#include <atomic>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/stores.h"
#include "tests/unit/store/engine.h"

namespace isomesh::store {
namespace {

class RaceConformance : public test::EngineTest {};

INSTANTIATE_TEST_SUITE_P(Engines, RaceConformance, testing::ValuesIn(test::all_engines()),
                         test::name_of);

TEST_P(RaceConformance, EveryJobIsClaimedByOneWorker) {
  constexpr int kJobs = 200;
  std::stop_source stop;
  std::mutex mutex;
  std::multiset<std::string> taken;
  std::vector<std::jthread> workers;
  for (int worker = 0; worker < 4; ++worker) {
    workers.emplace_back([&, name = "worker " + std::to_string(worker)] {
      while (!stop.stop_requested()) {
        const auto lease = jobs().claim(name, kLongLease);
        if (!lease) {
          jobs().wait_for_work(stop.get_token(), kLong);
          continue;
        }
        {
          const std::lock_guard lock(mutex);
          taken.insert(lease->id);
        }
        EXPECT_TRUE(jobs().finish(*lease, some_mesh()));
      }
    });
  }
  std::set<std::string> submitted;
  for (int n = 0; n < kJobs; ++n) submitted.insert(submit().id);
  for (const std::string& id : submitted) {
    EXPECT_EQ(test::end_of(jobs(), "", id).state, JobState::kSucceeded);
  }
  stop.request_stop();
  workers.clear();
  EXPECT_EQ(taken.size(), submitted.size());
  EXPECT_TRUE(std::ranges::equal(taken, submitted));
}

// However their claims meet: each sees the turns that the others have taken.
TEST_P(RaceConformance, WorkersSideBySideTakeTheOwnersByTurns) {
  constexpr int kClaims = 10;  // of each worker
  for (int n = 0; n < 4 * kClaims; ++n) submit(unlike(), "");
  for (int n = 0; n < 4 * kClaims; ++n) submit(unlike(), "other");
  std::atomic<int> of_other = 0;
  std::vector<std::jthread> workers;
  for (int worker = 0; worker < 4; ++worker) {
    workers.emplace_back([&, name = "worker " + std::to_string(worker)] {
      for (int n = 0; n < kClaims; ++n) {
        const auto lease = jobs().claim(name, kLongLease);
        ASSERT_TRUE(lease);
        if (lease->owner == "other") ++of_other;
      }
    });
  }
  workers.clear();
  EXPECT_EQ(of_other, 2 * kClaims);
}

// Each use of a mesh is one more job that has it, so the latest one changes all the time.
TEST_P(RaceConformance, ManyMayUseAMeshAtTheSameTime) {
  const JobParameters same = parameters();
  submit(same);
  const std::string blob = put_blob("a mesh");
  ASSERT_TRUE(jobs().finish(claimed(), mesh_of({{blob, 6}})));
  std::atomic<int> reused = 0;
  std::vector<std::jthread> clients;
  for (int client = 0; client < 16; ++client) {
    clients.emplace_back([&] {
      for (int n = 0; n < 30; ++n) reused += submit(same).reused ? 1 : 0;
    });
  }
  clients.clear();
  EXPECT_EQ(reused, 16 * 30);
}

TEST_P(RaceConformance, CancelAgainstFinishGivesOneEnd) {
  for (int round = 0; round < 100; ++round) {
    const std::string id = submit().id;
    const Lease lease = claimed();
    std::atomic<int> ready = 0;
    const auto together = [&] {
      ++ready;
      while (ready < 2) std::this_thread::yield();
    };
    bool finished = false;
    {
      std::jthread worker([&] {
        together();
        finished = jobs().finish(lease, some_mesh());
      });
      std::jthread canceller([&] {
        together();
        jobs().cancel("", id);
      });
    }
    EXPECT_TRUE(finished);
    const Job job = jobs().get("", id);
    ASSERT_TRUE(is_final(job.state));
    EXPECT_EQ(job.state == JobState::kSucceeded, job.mesh.has_value());
    EXPECT_EQ(job.state == JobState::kCancelled, !job.mesh.has_value());
    EXPECT_FALSE(jobs().finish(lease, {}));
    EXPECT_EQ(jobs().get("", id), job);
  }
}

// The end of one run is no news of the next one.
TEST_P(RaceConformance, ARunThatEndsDoesNotTouchTheNextOne) {
  for (int round = 0; round < 50; ++round) {
    const std::string id = submit().id;
    const Lease first = claimed();
    std::jthread worker([&] { jobs().put_back(first, std::chrono::milliseconds(0)); });
    std::optional<Lease> second;
    while (!second) second = jobs().claim("worker", kLongLease);
    EXPECT_EQ(second->id, id);
    worker.join();
    ASSERT_EQ(jobs().renew(*second, {Stage::kEncode, 0.9, {}}, kLongLease), Standing::kOk) << round;
    EXPECT_EQ(jobs().get("", id).stage, Stage::kEncode);
    EXPECT_TRUE(jobs().finish(*second, some_mesh()));
  }
}

TEST_P(RaceConformance, CancelAgainstClaimNeverLosesTheRequest) {
  for (int round = 0; round < 100; ++round) {
    const std::string id = submit().id;
    std::atomic<int> ready = 0;
    std::jthread worker([&] {
      ++ready;
      const auto lease = jobs().claim("worker", kLongLease);
      if (lease) jobs().finish(*lease, some_mesh());
    });
    while (ready < 1) std::this_thread::yield();
    const Job asked = jobs().cancel("", id);
    const Job ended = test::end_of(jobs(), "", id);
    // Whoever was told that it ran has asked it to stop.
    if (asked.state == JobState::kRunning) {
      EXPECT_EQ(ended.state, JobState::kCancelled);
    } else {
      EXPECT_EQ(ended.state, asked.state);
    }
  }
}

TEST_P(RaceConformance, AllWaitersWake) {
  const std::string id = submit().id;
  std::atomic<int> woken = 0;
  std::vector<std::jthread> waiters;
  for (int waiter = 0; waiter < 8; ++waiter) {
    waiters.emplace_back([&] {
      if (test::end_of(jobs(), "", id).state == JobState::kSucceeded) ++woken;
    });
  }
  jobs().finish(claimed(), some_mesh());
  waiters.clear();
  EXPECT_EQ(woken, 8);
}

TEST_P(RaceConformance, TheQueueNeverGrowsBeyondItsLimit) {
  make({.max_queued = 50});
  std::atomic<int> accepted = 0;
  std::vector<std::jthread> clients;
  for (int client = 0; client < 8; ++client) {
    clients.emplace_back([&] {
      for (int n = 0; n < 20; ++n) {
        if (jobs().submit({"", parameters(), "", ""}).kind == Submission::Kind::kNew) ++accepted;
      }
    });
  }
  clients.clear();
  EXPECT_EQ(accepted, 50);
  EXPECT_EQ(jobs().list("", {}, "", 1000).size(), 50U);
}

// Accepted at the same moment by all of these clients.
TEST_P(RaceConformance, AnOwnerNeverHasMoreThanItsShare) {
  make({.max_queued = 80});
  add_volume("third", kVolume);
  const auto accepted_of = [&](const std::string& owner, Priority priority) {
    std::atomic<int> accepted = 0;
    std::vector<std::jthread> clients;
    for (int client = 0; client < 8; ++client) {
      clients.emplace_back([&, client] {
        for (int n = 0; n < 10; ++n) {
          JobParameters own = parameters(priority);
          own.iso = client * 1000 + n;
          const auto kind = jobs().submit({owner, own, "", ""}).kind;
          if (kind == Submission::Kind::kNew) ++accepted;
          EXPECT_TRUE(kind == Submission::Kind::kNew || kind == Submission::Kind::kOwnersShare);
        }
      });
    }
    clients.clear();
    return accepted.load();
  };
  EXPECT_EQ(accepted_of("other", Priority::kStat), 5) << "half of an eighth";
  EXPECT_EQ(accepted_of("other", Priority::kBulk), 35) << "half of all";
  EXPECT_EQ(accepted_of("third", Priority::kStat), 3);
  EXPECT_EQ(accepted_of("third", Priority::kRoutine), 17);
}

// Each of these clients removes what it and the others have made.
TEST_P(RaceConformance, EqualJobsMayComeAndGo) {
  const JobParameters same = parameters();
  const std::string blob = put_blob("a mesh");
  std::vector<std::jthread> clients;
  for (int client = 0; client < 6; ++client) {
    clients.emplace_back([&, name = "worker " + std::to_string(client)] {
      for (int n = 0; n < 150; ++n) {
        ASSERT_NO_THROW({
          const std::string id = submit(same).id;
          const auto lease = jobs().claim(name, kLongLease);
          if (lease) jobs().finish(*lease, mesh_of({{blob, 6}}));
          jobs().erase("", id);
        });
      }
    });
  }
}

TEST_P(RaceConformance, OneKeyIsOfOneRequest) {
  for (int round = 0; round < 20; ++round) {
    std::atomic<int> created = 0;
    std::atomic<int> refused = 0;
    std::vector<std::jthread> clients;
    for (int client = 0; client < 8; ++client) {
      clients.emplace_back([&, digest = "digest " + std::to_string(client)] {
        const auto kind =
            jobs().submit({"", parameters(), "key " + std::to_string(round), digest}).kind;
        created += kind == Submission::Kind::kNew ? 1 : 0;
        refused += kind == Submission::Kind::kConflict ? 1 : 0;
      });
    }
    clients.clear();
    EXPECT_EQ(created, 1);
    EXPECT_EQ(refused, 7);
  }
}

TEST_P(RaceConformance, TheSameKeyFromEightClientsIsOneJob) {
  for (int round = 0; round < 20; ++round) {
    const JobSpec spec = {"", parameters(), "key " + std::to_string(round), "digest"};
    std::mutex mutex;
    std::set<std::string> ids;
    std::atomic<int> created = 0;
    std::vector<std::jthread> clients;
    for (int client = 0; client < 8; ++client) {
      clients.emplace_back([&] {
        const Submission submission = jobs().submit(spec);
        if (submission.kind == Submission::Kind::kNew) ++created;
        const std::lock_guard lock(mutex);
        ids.insert(submission.job.id);
      });
    }
    clients.clear();
    EXPECT_EQ(ids.size(), 1U);
    EXPECT_EQ(created, 1);
  }
}

// A reader that goes on after what it saw last misses nothing that is kept.
TEST_P(RaceConformance, ReadersOfEventsMissNoEnd) {
  constexpr int kJobs = 60;
  std::set<std::string> ended;
  std::jthread reader([&] {
    std::uint64_t since = 0;
    while (ended.size() < kJobs) {
      const auto events = jobs().events("", "", since, kLong);
      if (events.empty()) return;
      for (const Event& event : events) {
        EXPECT_GT(event.id, since);
        since = event.id;
        if (event.kind == EventKind::kDone) ended.insert(event.job);
      }
    }
  });
  std::vector<std::jthread> workers;
  for (int worker = 0; worker < 3; ++worker) {
    workers.emplace_back([&, worker] {
      for (int n = 0; n < kJobs / 3; ++n) {
        JobParameters own = parameters();
        own.iso = worker * 1000 + n;
        submit(own);
        const auto lease = jobs().claim("worker " + std::to_string(worker), kLongLease);
        ASSERT_TRUE(lease);
        for (const Stage stage : {Stage::kExtract, Stage::kSmooth, Stage::kEncode}) {
          jobs().renew(*lease, {stage, 0.5, {}}, kLongLease);
        }
        jobs().finish(*lease, some_mesh());
      }
    });
  }
  workers.clear();
  reader.join();
  EXPECT_EQ(ended.size(), static_cast<std::size_t>(kJobs));
}

}  // namespace
}  // namespace isomesh::store
