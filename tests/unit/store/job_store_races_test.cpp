// What several threads do to one JobStore at a time.
#include <algorithm>
#include <atomic>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "server/store/job_store.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"

namespace isomesh::store {
namespace {

constexpr std::chrono::milliseconds kLong{60'000};

class JobStoreRaces : public testing::Test {
 protected:
  std::string submit() { return jobs_.submit({}).id; }

  static Outcome some_mesh() {
    Outcome outcome;
    outcome.mesh.emplace();
    return outcome;
  }

  test::TemporaryFolder folder_;
  DataFolder data_{folder_ / "data"};
  BlobStore blobs_{data_};
  JobStore jobs_{blobs_, {.max_queued = 100'000, .max_finished = 100'000}};
};

TEST_F(JobStoreRaces, EveryJobIsClaimedByOneWorker) {
  constexpr int kJobs = 500;
  std::stop_source stop;
  std::mutex mutex;
  std::multiset<std::string> claimed;
  std::vector<std::jthread> workers;
  for (int worker = 0; worker < 4; ++worker) {
    workers.emplace_back([&] {
      while (const auto lease = jobs_.claim(stop.get_token())) {
        {
          const std::lock_guard lock(mutex);
          claimed.insert(lease->id);
        }
        EXPECT_TRUE(jobs_.finish(*lease, some_mesh(), {}));
      }
    });
  }
  std::set<std::string> submitted;
  for (int n = 0; n < kJobs; ++n) submitted.insert(submit());
  for (const std::string& id : submitted) {
    EXPECT_EQ(jobs_.wait(id, kLong).state, JobState::kSucceeded);
  }
  stop.request_stop();
  workers.clear();
  EXPECT_EQ(claimed.size(), submitted.size());
  EXPECT_TRUE(std::ranges::equal(claimed, submitted));
}

TEST_F(JobStoreRaces, CancelAgainstFinishGivesOneEnd) {
  for (int round = 0; round < 300; ++round) {
    const std::string id = submit();
    const Lease lease = jobs_.claim({}).value();
    std::atomic<int> ready = 0;
    const auto together = [&] {
      ++ready;
      while (ready < 2) std::this_thread::yield();
    };
    bool finished = false;
    {
      std::jthread worker([&] {
        together();
        finished = jobs_.finish(lease, some_mesh(), {});
      });
      std::jthread canceller([&] {
        together();
        jobs_.cancel(id);
      });
    }
    EXPECT_TRUE(finished);
    const Job job = jobs_.get(id);
    ASSERT_TRUE(is_final(job.state));
    EXPECT_EQ(job.state == JobState::kSucceeded, job.mesh.has_value());
    EXPECT_EQ(job.state == JobState::kCancelled, !job.mesh.has_value());
    EXPECT_FALSE(jobs_.finish(lease, {}, {}));
    EXPECT_EQ(jobs_.get(id), job);
  }
}

TEST_F(JobStoreRaces, CancelAgainstClaimNeverLosesTheRequest) {
  for (int round = 0; round < 300; ++round) {
    const std::string id = submit();
    std::atomic<int> ready = 0;
    std::stop_source stop;
    std::jthread worker([&] {
      ++ready;
      const auto lease = jobs_.claim(stop.get_token());
      if (lease) jobs_.finish(*lease, some_mesh(), {});
    });
    while (ready < 1) std::this_thread::yield();
    const Job asked = jobs_.cancel(id);
    const Job ended = asked.state == JobState::kRunning ? jobs_.wait(id, kLong) : asked;
    stop.request_stop();
    EXPECT_TRUE(ended.state == JobState::kCancelled || ended.state == JobState::kSucceeded);
    // Whoever was told that it ran has asked it to stop.
    if (asked.state == JobState::kRunning) {
      EXPECT_EQ(ended.state, JobState::kCancelled);
    }
  }
}

TEST_F(JobStoreRaces, AllWaitersWake) {
  const std::string id = submit();
  std::atomic<int> woken = 0;
  std::vector<std::jthread> waiters;
  for (int waiter = 0; waiter < 8; ++waiter) {
    waiters.emplace_back([&] {
      if (jobs_.wait(id, kLong).state == JobState::kSucceeded) ++woken;
    });
  }
  jobs_.finish(jobs_.claim({}).value(), some_mesh(), {});
  waiters.clear();
  EXPECT_EQ(woken, 8);
}

TEST_F(JobStoreRaces, TheQueueNeverGrowsBeyondItsLimit) {
  JobStore jobs(blobs_, {.max_queued = 50, .max_finished = 10});
  std::atomic<int> accepted = 0;
  std::vector<std::jthread> clients;
  for (int client = 0; client < 8; ++client) {
    clients.emplace_back([&] {
      for (int n = 0; n < 20; ++n) {
        if (!test::code_thrown_by([&] { jobs.submit({}); })) ++accepted;
      }
    });
  }
  clients.clear();
  EXPECT_EQ(accepted, 50);
  EXPECT_EQ(jobs.list({}, "", 1000).size(), 50U);
}

TEST_F(JobStoreRaces, WaitingForAJobThatIsForgottenEnds) {
  JobStore jobs(blobs_, {.max_queued = 1000, .max_finished = 1});
  for (int round = 0; round < 100; ++round) {
    const std::string id = jobs.submit({}).id;
    std::atomic<bool> waiting = false;
    std::jthread waiter([&] {
      waiting = true;
      test::code_thrown_by([&] { jobs.wait(id, kLong); });
    });
    while (!waiting) std::this_thread::yield();
    jobs.cancel(id);
    jobs.cancel(jobs.submit({}).id);
  }
}

}  // namespace
}  // namespace isomesh::store
