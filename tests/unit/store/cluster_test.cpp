// Tests of several processes that share the jobs of one database.
#include <chrono>
#include <set>
#include <span>
#include <string>
#include <thread>
#include <vector>

#include "tests/support/errors.h"
#include "tests/unit/store/cluster_fixture.h"

namespace isomesh::store::postgresql {
namespace {

using test::code_thrown_by;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

// --- One queue

TEST_F(ClusterTest, OneNodesJobIsAnothersWork) {
  std::string id;
  std::jthread submitter([&] {
    std::this_thread::sleep_for(milliseconds(50));
    id = submit();
  });
  // Told, and not asked for: nobody waits for a second.
  EXPECT_TRUE(two().jobs.wait_for_work({}, kLong));
  const Lease lease = two().claimed();
  submitter.join();
  EXPECT_EQ(lease.id, id);
  EXPECT_FALSE(one().can_claim());
  EXPECT_EQ(one().jobs.get("", id).state, JobState::kRunning);
}

TEST_F(ClusterTest, ProgressReachesTheOtherNodeWithARenewal) {
  const std::string id = submit();
  const Lease lease = two().claimed();
  two().jobs.renew(lease, {Stage::kSmooth, 0.5, {.load = 1, .extract = 2}}, kLongLease);
  const Job seen = one().jobs.get("", id);
  EXPECT_EQ(seen.stage, Stage::kSmooth);
  EXPECT_EQ(seen.progress, 0.5);
  EXPECT_EQ(seen.timing, two().jobs.get("", id).timing);
  EXPECT_EQ(seen.started, two().jobs.get("", id).started);
}

TEST_F(ClusterTest, ProgressIsToldToThoseWhoFollowTheJobAtAnotherNode) {
  const std::string id = submit();
  const Lease lease = two().claimed();
  std::uint64_t since = 0;
  // The next of it that node one tells, however long that takes.
  const auto next = [&] {
    Event event;
    do {
      event = one().jobs.events("", id, since, kLong).at(0);
      since = event.id;
    } while (event.state == JobState::kQueued || event.stage == Stage::kLoad);
    return event;
  };
  const auto share_of = [](const Event& event) {
    EXPECT_EQ(event.state, JobState::kRunning);
    EXPECT_TRUE(event.is_elsewhere);
    return event.progress;
  };
  two().jobs.renew(lease, {Stage::kSmooth, 0.25, {}}, kLongLease);
  const Event begun = next();
  EXPECT_EQ(begun.kind, EventKind::kStage);
  EXPECT_EQ(begun.stage, Stage::kSmooth);
  EXPECT_EQ(share_of(begun), 0.25);
  // As a renewal by the time that has passed.
  ask("UPDATE runs SET progress = 0.5");
  const Event further = next();
  EXPECT_EQ(further.kind, EventKind::kProgress);
  EXPECT_EQ(share_of(further), 0.5);
  EXPECT_THAT(one().jobs.events("somebody else", id, 0, milliseconds(0)), IsEmpty());
  EXPECT_TRUE(two().jobs.finish(lease, mesh()));
  EXPECT_EQ(next().kind, EventKind::kDone);
  EXPECT_EQ(two().jobs.events("", id, 0, milliseconds(0)).back().kind, EventKind::kDone);
}

TEST_F(ClusterTest, ProgressIsWrittenTwiceASecondAtMost) {
  SetClock clock;
  two_.emplace(url_, "two", blobs_, JobStoreOptions{.now = clock.reader()});
  submit();
  const Lease lease = two().claimed();
  ask("CREATE TABLE writes(n int); CREATE FUNCTION count_write() RETURNS trigger LANGUAGE plpgsql "
      "AS 'BEGIN INSERT INTO writes VALUES(1); RETURN NULL; END'; CREATE TRIGGER counts AFTER "
      "UPDATE ON runs FOR EACH ROW EXECUTE FUNCTION count_write()");
  double share = 0;
  const auto writes_of_ten_seconds = [&](double step) {
    ask("DELETE FROM writes");
    for (int n = 0; n < 100; ++n) {
      clock.pass(milliseconds(100));
      share += step;
      EXPECT_EQ(two().jobs.renew(lease, {Stage::kSmooth, share, {}}, kLongLease), Standing::kOk);
    }
    return std::stoi(ask("SELECT count(*) FROM writes"));
  };
  EXPECT_EQ(writes_of_ten_seconds(0.001), 20);
  EXPECT_NEAR(one().jobs.list("", {}, "", 1).at(0).progress, share, 0.005) << "half a second ago";
  EXPECT_EQ(writes_of_ten_seconds(0), 10);
}

// It was told by a newer node, which times more stages.
TEST_F(ClusterTest, TimingsAreReadByTheirNames) {
  const std::string id = submit();
  two().jobs.renew(two().claimed(), {Stage::kSmooth, 0.5, {}}, kLongLease);
  ask(R"(UPDATE runs SET timings = '{"load": 1, "thicken": 2, "smooth": 3}')");
  Timing timing = one().jobs.get("", id).timing;
  timing.queue = 0;
  EXPECT_EQ(timing, (Timing{.load = 1, .smooth = 3}));
}

TEST_F(ClusterTest, TheEndOfAJobIsHeardAtOnceByTheOtherNode) {
  const std::string id = submit();
  const Lease lease = two().claimed();
  const std::uint64_t since = test::events_of(one().jobs, "", id, 2).back().id;
  const auto began = std::chrono::steady_clock::now();
  std::vector<Event> seen;
  std::jthread reader([&] { seen = one().jobs.events("", id, since, kLong); });
  EXPECT_TRUE(two().jobs.finish(lease, mesh()));
  reader.join();
  ASSERT_THAT(seen, SizeIs(1));
  EXPECT_EQ(seen[0].state, JobState::kSucceeded);
  EXPECT_TRUE(seen[0].is_elsewhere);
  EXPECT_FALSE(two().jobs.events("", id, since, kLong)[0].is_elsewhere);
  EXPECT_LT(std::chrono::steady_clock::now() - began, seconds(30));
}

// A reader must not go on beyond what a slow transaction still holds.
TEST_F(ClusterTest, AnEventThatIsWrittenLateIsNotMissed) {
  const std::string slow = submit(1);
  const std::uint64_t since = one().jobs.events("", "", 0, milliseconds(0)).back().id;
  const auto told = [&] {
    std::vector<std::string> jobs;
    for (const Event& event : one().jobs.events("", "", since, milliseconds(0))) {
      jobs.push_back(event.job);
    }
    return jobs;
  };
  Connection connection(url_, Connection::Clock::now() + std::chrono::minutes(1));
  std::string quick;
  {
    Transaction transaction(connection);
    transaction->query("SELECT cancel_job(?1, '{}', ?2::uuid)", slow, two().database.node());
    quick = submit(2);
    EXPECT_THAT(told(), IsEmpty());
    transaction.commit();
  }
  EXPECT_THAT(told(), testing::ElementsAre(slow, quick));
}

// The slow transaction keeps node one from reading the end before the job is gone.
TEST_F(ClusterTest, TheEndOfAJobThatIsGoneAtOnceIsHeardByTheOtherNode) {
  const std::string erased = submit(1);
  const std::string of_volume = submit(2);
  const std::string expired = submit(3);
  const std::uint64_t since = test::events_of(one().jobs, "", expired, 1).back().id;
  Connection connection(url_, Connection::Clock::now() + std::chrono::minutes(1));
  {
    Transaction transaction(connection);
    transaction->query("SELECT pg_current_xact_id()");
    for (int n = 0; n < 3; ++n) ASSERT_TRUE(two().jobs.finish(two().claimed(), mesh()));
    EXPECT_TRUE(two().jobs.erase("", erased, {}));
    const auto ended = two().jobs.ended({.before = Time::max()}, Ended::kAll, 9);
    ASSERT_THAT(ended, SizeIs(2));
    EXPECT_THAT(two().jobs.expire(std::span(&ended.back(), 1), kAllBytes).records, SizeIs(1));
    two().volumes.erase("", kVolume, Made::kErased, {});
    EXPECT_EQ(ask("SELECT count(*) FROM jobs"), "0");
    transaction.commit();
  }
  std::set<std::string> heard;
  std::uint64_t last = since;
  while (heard.size() < 3) {
    const auto events = one().jobs.events("", "", last, kLong);
    ASSERT_THAT(events, Not(IsEmpty()));
    for (const Event& event : events) {
      if (event.kind == EventKind::kDone) heard.insert(event.job);
      last = event.id;
    }
  }
  EXPECT_THAT(heard, testing::UnorderedElementsAre(erased, of_volume, expired));
}

TEST_F(ClusterTest, ACancelReachesTheRunOfAnotherNode) {
  const std::string id = submit();
  const Lease lease = two().claimed();
  EXPECT_EQ(two().jobs.renew(lease, {}, kLongLease), Standing::kOk);
  EXPECT_EQ(one().jobs.cancel("", id).state, JobState::kRunning);
  const auto began = std::chrono::steady_clock::now();
  while (two().jobs.renew(lease, {}, kLongLease) != Standing::kCancel) {
    ASSERT_LT(std::chrono::steady_clock::now() - began, seconds(30));
    std::this_thread::sleep_for(milliseconds(20));
  }
  EXPECT_TRUE(two().jobs.finish(lease, mesh()));
  EXPECT_EQ(one().jobs.get("", id).state, JobState::kCancelled);
}

// --- Leases

TEST_F(ClusterTest, ANewLifeEndsTheRunsOfTheOneBeforeAndNoOthers) {
  const std::string lost = submit(1);
  one().claimed();
  submit(2);
  const Lease held = two().claimed();
  one_.emplace(url_, "one", blobs_);
  EXPECT_EQ(one().jobs.reap(), 1U);
  EXPECT_EQ(one().jobs.get("", lost).state, JobState::kQueued);
  EXPECT_EQ(two().jobs.renew(held, {}, kLongLease), Standing::kOk);
}

TEST_F(ClusterTest, ARunWhoseLeaseIsOverIsAnybodysAndItsNodeIsRefused) {
  const std::string id = submit();
  const Lease late = one().claimed(milliseconds(30));
  std::this_thread::sleep_for(milliseconds(60));
  EXPECT_EQ(two().jobs.reap(), 1U);
  const Lease lease = two().claimed();
  EXPECT_EQ(lease.id, id);
  EXPECT_EQ(lease.attempt, 1);
  EXPECT_GT(lease.fence, late.fence);
  EXPECT_EQ(one().jobs.renew(late, {}, kLongLease), Standing::kLost);
  EXPECT_FALSE(one().jobs.finish(late, mesh()));
  EXPECT_TRUE(two().jobs.finish(lease, mesh()));
}

// The database was away for longer than the lease.
TEST_F(ClusterTest, ARunThatNobodyTookGoesOnAfterItsLease) {
  const std::string id = submit();
  const Lease lease = one().claimed();
  end_leases();
  EXPECT_EQ(one().jobs.renew(lease, {Stage::kSmooth, 0.5, {}}, kLongLease), Standing::kOk);
  EXPECT_EQ(two().jobs.reap(), 0U);
  end_leases();
  EXPECT_TRUE(one().jobs.finish(lease, mesh())) << "it ended while the database was away";
  EXPECT_EQ(one().jobs.get("", id).state, JobState::kSucceeded);
  EXPECT_EQ(ask("SELECT count(*) FROM events WHERE state = 1"), "1");
}

TEST_F(ClusterTest, AfterAnOutageHoldersHaveTimeToRenew) {
  constexpr seconds kGrace{10};
  SetClock clock;
  two_.emplace(url_, "two", blobs_, JobStoreOptions{.grace = kGrace, .now = clock.reader()});
  submit(1);
  const Lease first = one().claimed();
  end_leases();
  // Looks every second, so often; returns how many leases it ended.
  const auto reaped_in = [&](int looks) {
    std::size_t count = 0;
    for (int look = 0; look < looks; ++look) {
      clock.pass(seconds(1));
      count += two().jobs.reap();
    }
    return count;
  };
  EXPECT_EQ(reaped_in(10), 0U) << "a start may follow an outage";
  EXPECT_EQ(reaped_in(1), 1U);
  EXPECT_EQ(one().jobs.renew(first, {}, kLongLease), Standing::kLost);
  const Lease second = one().claimed();
  end_leases();
  clock.pass(seconds(60));  // without an answer
  EXPECT_EQ(reaped_in(5), 0U);
  EXPECT_EQ(one().jobs.renew(second, {}, kLongLease), Standing::kOk);
  EXPECT_EQ(reaped_in(20), 0U);
  end_leases();
  EXPECT_EQ(reaped_in(1), 1U) << "no outage, no grace";
}

// Somebody saw that the lease was over, and its holder renewed it then.
TEST_F(ClusterTest, ALeaseThatWasRenewedMeanwhileIsNotEnded) {
  const std::string id = submit();
  const Lease lease = one().claimed();
  const auto end_by = [&](Node& node) {
    return ask(R"(SELECT outcome FROM finish_run('{"id": ")" + id + R"(", "fence": )" +
               std::to_string(lease.fence) + R"(, "node": ")" + node.database.node() +
               R"(", "is_again": false, "ends_others": true, "state": 0, "delay": 0, "counts": )" +
               R"(false}'))");
  };
  EXPECT_EQ(end_by(two()), "lost");
  EXPECT_EQ(one().jobs.renew(lease, {}, kLongLease), Standing::kOk);
  one_.emplace(url_, "one", blobs_);
  EXPECT_EQ(end_by(one()), "done") << "its own earlier life's";
}

// --- Lost connections

TEST_F(ClusterTest, LostConnectionsAreMadeAgain) {
  const std::string id = submit();
  cut_connections();
  const Lease lease = two().claimed();
  cut_connections();
  EXPECT_EQ(one().jobs.get("", id).state, JobState::kRunning);
  const std::uint64_t since = test::events_of(one().jobs, "", id, 2).back().id;
  std::vector<Event> seen;
  std::jthread reader([&] { seen = one().jobs.events("", id, since, kLong); });
  cut_connections();
  EXPECT_TRUE(two().jobs.finish(lease, mesh()));
  reader.join();
  EXPECT_THAT(seen, SizeIs(1));
  EXPECT_TRUE(one().jobs.responds());
}

// It ended, and the answer was lost: the same end again, and none by anybody else.
TEST_F(ClusterTest, AnEndThatIsAskedForAgainIsTheSameOne) {
  const std::string id = submit();
  const Lease lease = one().claimed();
  const auto end = [&](std::uint64_t fence, bool is_again) {
    return ask(R"(SELECT outcome FROM finish_run('{"id": ")" + id + R"(", "fence": )" +
               std::to_string(fence) + R"(, "node": ")" + one().database.node() +
               R"(", "is_again": )" + (is_again ? "true" : "false") +
               R"(, "ends_others": false, "state": 4, "record": "{}", "cancelled": "{}"}'))");
  };
  EXPECT_EQ(end(lease.fence, false), "done");
  EXPECT_EQ(end(lease.fence, true), "done");
  EXPECT_EQ(end(lease.fence, false), "lost");
  EXPECT_EQ(end(lease.fence + 1, true), "lost");
  EXPECT_EQ(ask("SELECT count(*) FROM events WHERE kind = 2"), "1");
}

TEST_F(ClusterTest, WithoutADatabaseNothingAnswers) {
  const std::string url = "postgresql://somebody@/nothing?host=/nowhere/at/all";
  const Error error =
      test::error_of([&] { Database({.url = url, .node = "x", .patience = milliseconds(0)}); });
  EXPECT_EQ(error.code(), ErrorCode::kUnavailable);
  EXPECT_THAT(error.what(), HasSubstr("/nowhere/at/all"));  // for the operator who starts it
}

TEST(ClusterUrl, HoldsNoPassword) {
  EXPECT_FALSE(code_thrown_by([] { check_url("postgresql://a@b/c?sslmode=verify-full"); }));
  for (const std::string url : {"postgresql://a:secret@b/c", "postgresql://b/c?password=secret",
                                "postgresql://b/c?secret=1", "mysql://b/secret", "secret"}) {
    const Error error = test::error_of([&] { check_url(url); }, url);
    EXPECT_EQ(error.code(), ErrorCode::kInvalidParameter);
    EXPECT_THAT(error.what(), Not(HasSubstr("secret")));
  }
}

}  // namespace
}  // namespace isomesh::store::postgresql
