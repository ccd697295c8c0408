// What several processes do that share the records of one database.
#include <array>
#include <chrono>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>

#include "server/store/files/blob_store.h"
#include "server/store/job_rules.h"
#include "server/store/postgresql/database.h"
#include "server/store/postgresql/identity.h"
#include "server/store/postgresql/job_store.h"
#include "server/store/postgresql/outbox.h"
#include "server/store/postgresql/turn.h"
#include "server/store/sql/audit_trail.h"
#include "server/store/sql/order_store.h"
#include "server/store/sql/volume_store.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"
#include "tests/support/postgres.h"

namespace isomesh::store::postgresql {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using test::code_thrown_by;
using test::Postgres;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

constexpr milliseconds kLongLease{600'000};
constexpr milliseconds kLong{60'000};
constexpr const char* kVolume = "some-volume";

// A process, but that it shares this one's memory.
struct Node {
  Node(const std::string& url, const std::string& name, const BlobStore& shared)
      : database({.url = url, .node = name}),
        volumes(database),
        outbox(database),
        jobs(database, shared, {.retry_delay = milliseconds(0), .mesher_version = "test"}) {}

  Lease claimed(milliseconds lease = kLongLease) { return jobs.claim("worker", lease).value(); }
  bool can_claim() { return jobs.wait_for_work({}, milliseconds(0)); }

  Database database;
  SqlVolumeStore volumes;
  PostgresOutbox outbox;
  PostgresJobStore jobs;
};

class ClusterTest : public testing::Test {
 protected:
  ClusterTest() : folder_(files_ / "data"), blobs_(shared_folder(), folder_.reserve()) {}

  void SetUp() override {
    if (!Postgres::is_here()) GTEST_SKIP() << "PostgreSQL is not installed";
    url_ = Postgres::shared().new_place();
    one_.emplace(url_, "one", blobs_);
    two_.emplace(url_, "two", blobs_);
    Volume volume;
    volume.id = kVolume;
    volume.created = "2024-01-01T00:00:00.000Z";
    one_->volumes.add("", volume);
  }

  static JobSpec spec(double iso = 60, const std::string& key = "") {
    JobSpec spec;
    spec.parameters.volume = kVolume;
    spec.parameters.iso = iso;
    spec.idempotency_key = key;
    return spec;
  }
  std::string submit(double iso = 60) { return job_of(one().jobs.submit(spec(iso))).id; }

  Outcome mesh() {
    Outcome outcome;
    MeshFile& file = outcome.mesh.emplace().files[MeshFormat::kDrc];
    const Blob blob = put("mesh");
    file.sha256 = blob.key;
    file.bytes = blob.bytes;
    return outcome;
  }
  Blob put(const std::string& text) {
    const auto writer = blobs_.begin();
    writer->write(test::as_span(text));
    return writer->commit();
  }

  // As when the network fails or the server restarts.
  void cut_connections() {
    Postgres::ask(url_,
                  "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE pid <> "
                  "pg_backend_pid() AND backend_type = 'client backend'");
  }
  std::string ask(const std::string& sql) { return Postgres::ask(url_, sql); }

  BlobFolders shared_folder() const {
    std::filesystem::create_directory(files_ / "shared");
    return shared_blob_folders(files_ / "shared");
  }

  Node& one() { return *one_; }
  Node& two() { return *two_; }

  test::TemporaryFolder files_;
  DataFolder folder_;
  FileBlobStore blobs_;
  std::string url_;
  std::optional<Node> one_;
  std::optional<Node> two_;
};

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

// It was told by a newer node, which times more stages, or by one of the first version.
TEST_F(ClusterTest, TimingsAreReadByTheirNames) {
  const std::string id = submit();
  two().jobs.renew(two().claimed(), {Stage::kSmooth, 0.5, {}}, kLongLease);
  ask(R"(UPDATE runs SET timings = '{"load": 1, "thicken": 2, "smooth": 3}')");
  Timing timing = one().jobs.get("", id).timing;
  timing.queue = 0;
  EXPECT_EQ(timing, (Timing{.load = 1, .smooth = 3}));
  ask("UPDATE runs SET timings = NULL");
  timing = one().jobs.get("", id).timing;
  timing.queue = 0;
  EXPECT_EQ(timing, Timing{});
}

TEST_F(ClusterTest, OfJobsAlikeOneRunsOverAllNodes) {
  const std::string first = submit();
  const std::string second = job_of(two().jobs.submit(spec())).id;
  const Lease lease = one().claimed();
  EXPECT_FALSE(two().jobs.claim("worker", kLongLease));
  EXPECT_TRUE(one().jobs.finish(lease, mesh()));
  for (const std::string& id : {first, second}) {
    EXPECT_EQ(two().jobs.get("", id).state, JobState::kSucceeded);
  }
  EXPECT_TRUE(two().jobs.get("", second).reused);
  EXPECT_TRUE(job_of(two().jobs.submit(spec())).reused);
}

TEST_F(ClusterTest, OneKeyIsOneJobOverAllNodes) {
  for (int round = 0; round < 10; ++round) {
    const JobSpec both = spec(round, "key " + std::to_string(round));
    std::array<std::string, 2> ids;
    std::jthread other([&] { ids[1] = job_of(two().jobs.submit(both)).id; });
    ids[0] = job_of(one().jobs.submit(both)).id;
    other.join();
    EXPECT_EQ(ids[0], ids[1]);
  }
}

TEST_F(ClusterTest, TheEndOfAJobIsHeardAtOnceByTheOtherNode) {
  const std::string id = submit();
  const Lease lease = two().claimed();
  const std::uint64_t since = one().jobs.events("", id, 0, milliseconds(0)).back().id;
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
  Connection connection(url_);
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

// --- Lost connections

TEST_F(ClusterTest, LostConnectionsAreMadeAgain) {
  const std::string id = submit();
  cut_connections();
  const Lease lease = two().claimed();
  cut_connections();
  EXPECT_EQ(one().jobs.get("", id).state, JobState::kRunning);
  const std::uint64_t since = one().jobs.events("", id, 0, milliseconds(0)).back().id;
  std::vector<Event> seen;
  std::jthread reader([&] { seen = one().jobs.events("", id, since, kLong); });
  cut_connections();
  EXPECT_TRUE(two().jobs.finish(lease, mesh()));
  reader.join();
  EXPECT_THAT(seen, SizeIs(1));
  EXPECT_TRUE(one().jobs.answers());
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
  const auto error =
      test::thrown_by([&] { Database({.url = url, .node = "x", .patience = milliseconds(0)}); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), ErrorCode::kUnavailable);
  EXPECT_THAT(error->what(), HasSubstr("/nowhere/at/all"));  // for the operator who starts it
}

TEST(ClusterUrl, HoldsNoPassword) {
  EXPECT_FALSE(code_thrown_by([] { check_url("postgresql://a@b/c?sslmode=verify-full"); }));
  for (const std::string url : {"postgresql://a:secret@b/c", "postgresql://b/c?password=secret",
                                "postgresql://b/c?secret=1", "mysql://b/secret", "secret"}) {
    const auto error = test::thrown_by([&] { check_url(url); });
    ASSERT_TRUE(error) << url;
    EXPECT_EQ(error->code(), ErrorCode::kInvalidParameter);
    EXPECT_THAT(error->what(), Not(HasSubstr("secret")));
  }
}

// --- Tables

TEST_F(ClusterTest, TablesOfANewerVersionAreRefused) {
  ask("UPDATE isomesh_version SET version = 1000");
  EXPECT_EQ(code_thrown_by([&] { Database({.url = url_, .node = "x"}); }), ErrorCode::kUnavailable);
}

TEST_F(ClusterTest, TablesOfTheVersionBeforeAreBroughtUpToDate) {
  const std::string id = submit();
  ask("ALTER TABLE runs DROP COLUMN timings; DROP FUNCTION submit_job(jsonb); DROP VIEW "
      "queued_owners; DROP TABLE turns; DROP INDEX jobs_by_turn; ALTER TABLE jobs DROP COLUMN "
      "cost; "
      "CREATE INDEX jobs_queue ON jobs(priority, seq) WHERE state = 0; UPDATE isomesh_version SET "
      "version = 1");
  one_.emplace(url_, "one", blobs_);
  const Lease lease = one().claimed();
  EXPECT_EQ(lease.id, id);
  one().jobs.renew(lease, {Stage::kSmooth, 0.5, {.load = 1}}, kLongLease);
  EXPECT_EQ(two().jobs.get("", id).timing.load, 1);
  submit(2);
}

TEST_F(ClusterTest, SeveralThatStartAtOnceMakeThemOnce) {
  const std::string place = Postgres::shared().new_place();
  std::vector<std::jthread> nodes;
  for (int n = 0; n < 6; ++n) {
    nodes.emplace_back([&, n] { Database({.url = place, .node = std::to_string(n)}); });
  }
  nodes.clear();
  EXPECT_EQ(Postgres::ask(place, "SELECT count(*) FROM nodes"), "6");
  EXPECT_EQ(Postgres::ask(place, "SELECT count(*) FROM isomesh_version"), "1");
}

TEST_F(ClusterTest, TheAuditTrailIsNotChanged) {
  for (const std::string sql :
       {"UPDATE audit SET record = ''", "DELETE FROM audit", "TRUNCATE audit"}) {
    EXPECT_THROW(ask(sql), std::runtime_error) << sql;
  }
}

TEST_F(ClusterTest, TheAuditTrailTellsWhichEntryWasTamperedWith) {
  for (int n = 0; n < 5; ++n) SqlAuditTrail((n % 2 ? one() : two()).database).add({});
  EXPECT_EQ(SqlAuditTrail(one().database).verify().entries, 5U);
  ask("ALTER TABLE audit DISABLE TRIGGER audit_is_kept; UPDATE audit SET at = '' WHERE id = 3");
  EXPECT_EQ(SqlAuditTrail(one().database).verify().misfit, 3U);
}

// --- What is not kept

TEST_F(ClusterTest, OneRemovesAtATime) {
  auto turn = one().jobs.turn_to_remove();
  EXPECT_TRUE(turn);
  EXPECT_FALSE(two().jobs.turn_to_remove());
  turn.reset();
  EXPECT_TRUE(two().jobs.turn_to_remove());
}

// The newest time that is known is 40 days later than the database's clock.
TEST_F(ClusterTest, WhatIsUsedIsNeverOlderThanTheNewestTimeThatIsKnown) {
  Identity(one().database, blobs_, {.adopt = true}, seconds(1)).now();
  ask("UPDATE identity SET seen = isomesh_now() + 40 * 86400000000");
  Volume volume;
  volume.id = "another";
  volume.created = "2024-01-01T00:00:00.000Z";
  one().volumes.add("", volume);
  two().jobs.cancel("", submit());
  EXPECT_EQ(ask("SELECT count(*) FROM volumes, identity WHERE used < seen"), "0");
  EXPECT_EQ(ask("SELECT count(*) FROM jobs, identity WHERE finished < seen"), "0");
  Identity behind(two().database, blobs_, {}, seconds(1));
  EXPECT_GT(behind.now(), std::chrono::system_clock::now() + std::chrono::days(39));
}

// The one was used right before the time until which the clock was behind, the other long before.
TEST_F(ClusterTest, AClockThatIsTrustedLetsExpireWhatWasOldBefore) {
  Identity(one().database, blobs_, {.adopt = true}, seconds(1)).now();
  const std::string id = submit();
  one().jobs.cancel("", id);
  ask("UPDATE identity SET seen = isomesh_now() - 40 * 86400000000; UPDATE volumes SET used = "
      "isomesh_now() - 40 * 86400000000; UPDATE jobs SET finished = isomesh_now() - 60 * "
      "86400000000");
  Identity trusting(two().database, blobs_, {.trust_clock = true}, std::chrono::days(7));
  const Time month_ago = trusting.now() - std::chrono::days(30);
  EXPECT_THAT(two().jobs.ended({month_ago}, Ended::kAll, 9), SizeIs(1));
  EXPECT_THAT(two().volumes.unused({month_ago}, 9), IsEmpty());
}

// --- Orders

// Who carries them out has the turn as long as it lives, and takes orders meanwhile.
TEST_F(ClusterTest, OrdersAreTakenByWhoCarriesThemOut) {
  const Turn turn(url_, "orders");
  ASSERT_TRUE(turn.is_taken());
  OrderSpec order;
  order.record.order.id = "an order";
  order.record.order.created = "2024-01-01T00:00:00.000Z";
  EXPECT_EQ(SqlOrderStore(one().database).submit(order, 1).kind, OrderSubmission::Kind::kNew);
}

// --- Callbacks

TEST_F(ClusterTest, OneReceiverIsToldNoMoreAtATimeByAllNodes) {
  for (int n = 0; n < 6; ++n) {
    JobSpec calling = spec(n);
    calling.parameters.callback = Callback{"https://a.example.org/" + std::to_string(n)};
    one().jobs.cancel("", job_of(one().jobs.submit(calling)).id);
  }
  const Time now = std::chrono::system_clock::now() + seconds(1);
  const auto mine = one().outbox.due(now, 4);
  EXPECT_THAT(mine, SizeIs(4));
  EXPECT_THAT(two().outbox.due(now, 4), IsEmpty());
  one().outbox.remove(mine[0].job);
  const auto theirs = two().outbox.due(now, 4);
  ASSERT_THAT(theirs, SizeIs(1));
  for (const Delivery& each : mine) EXPECT_NE(each.job, theirs[0].job);
  EXPECT_THAT(one().outbox.due(now, 4), SizeIs(3));
}

// --- Databases and blobs

// Whether a daemon of that database starts with those blobs.
bool belong(Database& database, const BlobStore& blobs, bool adopt = false) {
  const auto code =
      code_thrown_by([&] { Identity(database, blobs, {.adopt = adopt}, seconds(1)); });
  EXPECT_EQ(code.value_or(ErrorCode::kUnavailable), ErrorCode::kUnavailable);
  return !code;
}

TEST_F(ClusterTest, ADatabaseAndBlobsThatAreNotItsOwnAreRefused) {
  const std::string url = Postgres::shared().new_place();
  Database database({.url = url, .node = "x"});
  Database again({.url = url, .node = "y"});
  EXPECT_TRUE(belong(database, blobs_));
  EXPECT_TRUE(belong(again, blobs_));
  Database other({.url = Postgres::shared().new_place(), .node = "x"});
  EXPECT_FALSE(belong(other, blobs_));
  EXPECT_TRUE(belong(other, blobs_, true));
  EXPECT_FALSE(belong(database, blobs_));
}

TEST_F(ClusterTest, BlobsOfOneDaemonAloneAreNotThoseOfASecond) {
  Database database({.url = Postgres::shared().new_place(), .node = "x"});
  const DataFolder mine(files_ / "mine");
  const DataFolder others(files_ / "others");
  EXPECT_TRUE(belong(database, FileBlobStore(mine)));
  EXPECT_FALSE(belong(database, FileBlobStore(others)));
  EXPECT_TRUE(belong(database, FileBlobStore(mine)));
}

// The store's URL is wrong, or nothing is mounted there.
TEST_F(ClusterTest, BlobsThatAreMissingAreMissed) {
  EXPECT_FALSE(belong(one().database, blobs_)) << "there are records, and no blobs";
  EXPECT_TRUE(belong(one().database, blobs_, true));
  EXPECT_TRUE(belong(two().database, blobs_));
}

}  // namespace
}  // namespace isomesh::store::postgresql
