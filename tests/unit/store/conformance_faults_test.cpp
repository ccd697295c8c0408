// Tests of expired leases, failures, retried requests, identical jobs and events on every engine.
#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>

#include "proto/error.h"
#include "tests/support/errors.h"
#include "tests/support/process.h"
#include "tests/support/stores.h"
#include "tests/unit/store/engine.h"
#include "tests/unit/store/wall_clock.h"

namespace isomesh::store {
namespace {

using std::chrono::milliseconds;
using test::code_thrown_by;
using testing::ElementsAre;
using testing::IsEmpty;
using Kind = Submission::Kind;

class FaultConformance : public test::EngineTest {
 protected:
  static constexpr milliseconds kShortLease{30};

  Lease expired() {
    const Lease lease = claimed(kShortLease);
    std::this_thread::sleep_for(2 * kShortLease);
    return lease;
  }

  Submission submit_with(const std::string& key, const std::string& digest,
                         const std::string& owner = "") {
    return jobs().submit({owner, parameters(), key, digest});
  }

  std::vector<Event> events_of(const std::string& job, std::size_t count, std::uint64_t since = 0) {
    return test::events_of(jobs(), "", job, count, since);
  }

  std::vector<EventKind> kinds_of(const std::string& job, std::size_t count,
                                  std::uint64_t since = 0) {
    std::vector<EventKind> kinds;
    for (const Event& event : events_of(job, count, since)) {
      EXPECT_EQ(event.job, job);
      kinds.push_back(event.kind);
    }
    return kinds;
  }
};

INSTANTIATE_TEST_SUITE_P(Engines, FaultConformance, testing::ValuesIn(test::all_engines()),
                         test::name_of);

// --- Leases

TEST_P(FaultConformance, ARenewedLeaseHolds) {
  // A machine that stands still lets the lease run out before it is renewed: then with a longer
  // one.
  for (milliseconds length{100};; length *= 2) {
    ASSERT_LT(length, kLong);
    submit();
    const Lease lease = claimed(length);
    if (jobs().renew(lease, {}, kLongLease) == Standing::kLost) {
      jobs().reap();
      continue;
    }
    std::this_thread::sleep_for(length);
    EXPECT_EQ(jobs().reap(), 0U);
    EXPECT_EQ(jobs().renew(lease, {}, kLongLease), Standing::kOk);
    EXPECT_TRUE(jobs().finish(lease, some_mesh()));
    return;
  }
}

TEST_P(FaultConformance, AReapedJobIsClaimedAgainAndItsLateWorkerIsRefused) {
  const Job job = submit();
  const Lease late = expired();
  EXPECT_EQ(jobs().reap(), 1U);
  EXPECT_EQ(jobs().reap(), 0U);
  EXPECT_EQ(jobs().get("", job.id), job);
  const Lease lease = claimed();
  EXPECT_EQ(lease.attempt, 1);
  EXPECT_GT(lease.fence, late.fence);
  EXPECT_EQ(jobs().renew(late, {Stage::kEncode, 0.9, {}}, kLongLease), Standing::kLost);
  EXPECT_FALSE(jobs().finish(late, some_mesh()));
  EXPECT_FALSE(jobs().put_back(late, milliseconds(0)));
  EXPECT_EQ(jobs().get("", job.id).stage, Stage::kLoad);
  EXPECT_TRUE(jobs().finish(lease, some_mesh()));
}

// A worker that stalls or dies is a fault of the service, not of the job.
TEST_P(FaultConformance, AJobThatLosesItsWorkersIsNeverCharged) {
  const std::string id = submit().id;
  for (int run = 1; run <= 12; ++run) {
    const bool stands_still = run % 2 == 0;
    const Lease lease = stands_still ? expired() : claimed();
    EXPECT_EQ(lease.id, id);
    EXPECT_EQ(lease.attempt, 1);
    if (stands_still) {
      EXPECT_EQ(jobs().reap(), 1U);
      EXPECT_EQ(jobs().renew(lease, {Stage::kSmooth, 0.5, {}}, kLongLease), Standing::kLost);
    } else {
      EXPECT_EQ(jobs().renew(lease, {Stage::kSmooth, 0.5, {}}, kLongLease), Standing::kOk);
      restart();
    }
    EXPECT_EQ(jobs().get("", id).state, JobState::kQueued);
    EXPECT_EQ(jobs().account(id).attempts, 0);
  }
  EXPECT_TRUE(jobs().finish(claimed(), some_mesh()));
}

// Failures of the job itself still count as attempts.
TEST_P(FaultConformance, ALostWorkerForgivesNoFailure) {
  const std::string id = submit().id;
  EXPECT_TRUE(jobs().finish(claimed(), failure(true)));
  claimed();
  restart();
  EXPECT_EQ(jobs().account(id).attempts, 1);
  EXPECT_TRUE(jobs().finish(claimed(), failure(true)));
  const Lease last = claimed();
  EXPECT_EQ(last.attempt, 3);
  EXPECT_TRUE(jobs().finish(last, failure(true)));
  EXPECT_EQ(jobs().get("", id).state, JobState::kFailed);
}

TEST_P(FaultConformance, ACancelledJobWhoseLeaseRunsOutEndsCancelled) {
  const std::string id = submit().id;
  expired();
  jobs().cancel("", id);
  EXPECT_EQ(jobs().reap(), 1U);
  EXPECT_EQ(jobs().get("", id).state, JobState::kCancelled);
}

// --- Failures

TEST_P(FaultConformance, AFailureThatMayPassIsTriedThreeTimes) {
  constexpr milliseconds kDelay{40};
  make({.retry_delay = kDelay});
  const std::string id = submit().id;
  Time failed = {};
  for (int attempt = 1; attempt <= 3; ++attempt) {
    ASSERT_TRUE(jobs().wait_for_work({}, kLong));
    const Lease lease = claimed();
    EXPECT_GE(std::chrono::system_clock::now() - failed, attempt == 3 ? 4 * kDelay : kDelay);
    EXPECT_EQ(lease.attempt, attempt);
    EXPECT_EQ(jobs().account(id).attempts, attempt);
    failed = std::chrono::system_clock::now();
    EXPECT_TRUE(jobs().finish(lease, failure(true)));
  }
  EXPECT_FALSE(jobs().claim("worker", kLongLease));
  EXPECT_EQ(jobs().get("", id).state, JobState::kFailed);
  EXPECT_EQ(jobs().get("", id).error, failure().error);
  EXPECT_EQ(jobs().account(id).attempts, 3);
  EXPECT_EQ(jobs().account(id).job, jobs().get("", id));
  EXPECT_EQ(code_thrown_by([&] { jobs().account("x"); }), ErrorCode::kNotFound);
}

// --- Idempotency

TEST_P(FaultConformance, TheSameKeyAndRequestIsTheSameJob) {
  const Submission first = submit_with("key", "digest");
  EXPECT_EQ(first.kind, Kind::kNew);
  const Submission again = submit_with("key", "digest");
  EXPECT_EQ(again.kind, Kind::kExisting);
  EXPECT_EQ(again.job, first.job);
  jobs().finish(claimed(), some_mesh());
  restart();
  EXPECT_EQ(submit_with("key", "digest").job, jobs().get("", first.job.id));
  EXPECT_EQ(jobs().list("", {}, "", 10).size(), 1U);
}

TEST_P(FaultConformance, AKeyWithAnotherRequestIsRefused) {
  submit_with("key", "digest");
  EXPECT_EQ(submit_with("key", "other digest").kind, Kind::kConflict);
  EXPECT_EQ(code_thrown_by([&] { job_of(submit_with("key", "other digest")); }),
            ErrorCode::kKeyReused);
  EXPECT_EQ(jobs().list("", {}, "", 10).size(), 1U);
}

TEST_P(FaultConformance, KeysOfOwnersAreApart) {
  const Submission mine = submit_with("key", "digest");
  const Submission theirs = submit_with("key", "other digest", "other");
  EXPECT_EQ(theirs.kind, Kind::kNew);
  EXPECT_NE(theirs.job.id, mine.job.id);
}

TEST_P(FaultConformance, AKeyIsKnownThoughTheQueueIsFull) {
  make({.max_queued = 1});
  const Submission first = submit_with("key", "digest");
  EXPECT_EQ(submit_with("another", "digest").kind, Kind::kBusy);
  EXPECT_EQ(submit_with("key", "digest").job, first.job);
  jobs().cancel("", first.job.id);
  EXPECT_EQ(submit_with("another", "digest").kind, Kind::kNew);
}

// --- Jobs alike

TEST_P(FaultConformance, AJobLikeAFinishedOneTakesItsMeshAtOnce) {
  const Job first = submit(parameters());
  jobs().finish(claimed(), some_mesh());
  const Job second = submit(parameters(Priority::kStat));
  EXPECT_NE(second.id, first.id);
  EXPECT_EQ(second.state, JobState::kSucceeded);
  EXPECT_TRUE(second.reused);
  EXPECT_FALSE(jobs().get("", first.id).reused);
  EXPECT_EQ(second.mesh->triangles, 12U);
  EXPECT_EQ(second.mesh->files.at(MeshFormat::kDrc).href, "/v1/jobs/" + second.id + "/mesh.drc");
  EXPECT_TRUE(second.finished);
  EXPECT_EQ(jobs().get("", second.id), second);
  EXPECT_FALSE(can_claim());
}

TEST_P(FaultConformance, AnyOtherParameterIsAnotherMesh) {
  submit(parameters());
  jobs().finish(claimed(), some_mesh());
  JobParameters other = parameters();
  other.passes += 1;
  EXPECT_FALSE(submit(other).reused);
}

TEST_P(FaultConformance, AnotherOwnersMeshIsNotTaken) {
  submit(parameters());
  jobs().finish(claimed(), some_mesh());
  const Job theirs = submit(parameters(), "other");
  EXPECT_FALSE(theirs.reused);
  EXPECT_EQ(claimed().id, theirs.id);
}

TEST_P(FaultConformance, AMeshWhoseBytesAreGoneIsMadeAgain) {
  const std::string key = put_blob("lost");
  submit(parameters());
  jobs().finish(claimed(), mesh_of({{key, 4}}));
  blobs().erase(key);
  EXPECT_FALSE(submit(parameters()).reused);
  EXPECT_TRUE(can_claim());
}

TEST_P(FaultConformance, AMeshIsRemadeByOneJobUntilThatFails) {
  const std::string id = submit(parameters()).id;
  jobs().finish(claimed(), some_mesh());
  // There is a mesh like it, which was damaged by now.
  const Job mine = jobs().get("", id);
  for (const auto& blob : mine.mesh->files) blobs().erase(blob.second.sha256);
  const std::string again = jobs().remake(id).id;
  EXPECT_NE(again, id);
  EXPECT_EQ(jobs().remake(id).id, again);
  jobs().finish(claimed(), failure());
  EXPECT_EQ(jobs().remake(id).id, again);
  EXPECT_FALSE(can_claim());
}

TEST_P(FaultConformance, AMeshIsRemadeOnceItsDamagedVolumeIsBack) {
  const std::string volume = put_blob("samples");
  add_volume("", volume);
  JobParameters wanted = parameters();
  wanted.volume = volume;
  const std::string id = submit(wanted).id;
  const std::string key = put_blob("mesh");
  jobs().finish(claimed(), mesh_of({{key, 4}}));
  blobs().erase(key);
  blobs().erase(volume);
  const std::string failed = jobs().remake(id).id;
  Outcome damaged;
  damaged.error = to_problem(Error(ErrorCode::kUnusableVolume, "it is damaged"), "");
  jobs().finish(claimed(), damaged);
  EXPECT_EQ(jobs().remake(id).id, failed);
  put_blob("samples");
  const std::string again = jobs().remake(id).id;
  EXPECT_NE(again, failed);
  EXPECT_EQ(jobs().remake(id).id, again);
  EXPECT_EQ(claimed().id, again);
}

TEST_P(FaultConformance, JobsAlikeAreComputedOnce) {
  const std::string first = submit(parameters(Priority::kBulk)).id;
  const std::string second = submit(parameters()).id;
  const Lease lease = claimed();
  EXPECT_EQ(lease.id, second);
  EXPECT_FALSE(can_claim());
  EXPECT_FALSE(jobs().claim("worker", kLongLease));
  EXPECT_EQ(jobs().get("", first).state, JobState::kQueued);
  jobs().finish(lease, some_mesh());
  const Job other = jobs().get("", first);
  EXPECT_EQ(other.state, JobState::kSucceeded);
  EXPECT_TRUE(other.reused);
  EXPECT_EQ(other.mesh->files.at(MeshFormat::kDrc).href, "/v1/jobs/" + first + "/mesh.drc");
  EXPECT_FALSE(jobs().get("", second).reused);
}

TEST_P(FaultConformance, AJobGoesOnWhenItsLikeEndsWithoutAMesh) {
  submit(parameters());
  const std::string second = submit(parameters()).id;
  jobs().finish(claimed(), failure());
  EXPECT_EQ(claimed().id, second);
}

// --- Events

TEST_P(FaultConformance, EventsTellAJobsWay) {
  const std::string id = submit().id;
  const std::string other = submit().id;
  const Lease lease = claimed();
  jobs().renew(lease, {Stage::kSmooth, 0.3, {}}, kLongLease);
  std::this_thread::sleep_for(milliseconds(120));
  jobs().renew(lease, {Stage::kSmooth, 0.5, {}}, kLongLease);
  jobs().finish(lease, some_mesh());
  const auto events = events_of(id, 5);
  ASSERT_THAT(kinds_of(id, 5), ElementsAre(EventKind::kStage, EventKind::kStage, EventKind::kStage,
                                           EventKind::kProgress, EventKind::kDone));
  EXPECT_EQ(events[1].stage, Stage::kLoad);
  EXPECT_EQ(events[2].stage, Stage::kSmooth);
  EXPECT_EQ(events[3].progress, 0.5);
  EXPECT_EQ(events[4].state, JobState::kSucceeded);
  EXPECT_THAT(kinds_of(id, 1, events[3].id), ElementsAre(EventKind::kDone));
  EXPECT_THAT(kinds_of(other, 1), ElementsAre(EventKind::kStage));
  EXPECT_EQ(events_of("", 6).size(), 6U);
}

TEST_P(FaultConformance, ProgressIsToldAFewTimesASecond) {
  const std::string id = submit().id;
  const Lease lease = claimed();
  jobs().renew(lease, {Stage::kSmooth, 0, {}}, kLongLease);
  const std::uint64_t since = events_of(id, 3).back().id;
  const auto began = std::chrono::steady_clock::now();
  for (int n = 1; n <= 50; ++n) jobs().renew(lease, {Stage::kSmooth, 0.01 * n, {}}, kLongLease);
  // However long that took on a busy machine.
  const auto took = std::chrono::steady_clock::now() - began;
  EXPECT_LE(kinds_of(id, 0, since).size(), 1 + static_cast<std::size_t>(took / milliseconds(100)));
}

TEST_P(FaultConformance, WhatWasKeptIsToldAfterARestartInOrder) {
  const std::string id = submit().id;
  const Lease lease = claimed();
  jobs().renew(lease, {Stage::kSmooth, 0.3, {}}, kLongLease);
  const std::uint64_t last = events_of(id, 3).back().id;
  restart();
  EXPECT_THAT(kinds_of(id, 1, last), ElementsAre(EventKind::kStage)) << "queued again";
  EXPECT_THAT(kinds_of(id, 3),
              ElementsAre(EventKind::kStage, EventKind::kStage, EventKind::kStage));
}

TEST_P(FaultConformance, ReadersOfEventsAreWoken) {
  const std::string id = submit().id;
  const std::uint64_t since = events_of(id, 1).back().id;
  std::vector<Event> seen;
  std::jthread reader([&] { seen = jobs().events("", id, since, kLong); });
  claimed();
  reader.join();
  ASSERT_EQ(seen.size(), 1U);
  EXPECT_EQ(seen[0].state, JobState::kRunning);
  EXPECT_THAT(jobs().events("", id, seen[0].id, milliseconds(5)), IsEmpty());
}

TEST_P(FaultConformance, AClockThatIsSetEndsNoLease) {
  const std::string id = submit().id;
  const Lease lease = claimed();
  for (const int ahead : {40, -40}) {
    const test::ClockSetAhead set(std::chrono::days(1) * ahead);
    EXPECT_EQ(jobs().reap(), 0U) << ahead;
    EXPECT_EQ(jobs().renew(lease, {}, kLongLease), Standing::kOk) << ahead;
  }
  const test::ClockSetAhead set(std::chrono::days(40));
  EXPECT_TRUE(jobs().finish(lease, some_mesh()));
  EXPECT_EQ(jobs().account(id).attempts, 1);
}

TEST_P(FaultConformance, AClockThatIsSetBackHoldsNoJobUp) {
  submit();
  {
    const test::ClockSetAhead set(std::chrono::days(40));
    jobs().put_back(claimed(), milliseconds(1000));
  }
  // At once, or by a clock that was not set: in a second.
  EXPECT_TRUE(jobs().wait_for_work({}, kLong));
  EXPECT_TRUE(jobs().claim("worker", kLongLease));
}

}  // namespace
}  // namespace isomesh::store
