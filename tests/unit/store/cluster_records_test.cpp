// Tests of several processes that share one database's records other than jobs: tables, retention,
// orders, callbacks and blob ownership.
#include <csignal>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "server/hospital/records/order_store.h"
#include "server/hospital/records/tables.h"
#include "server/store/audit/trail.h"
#include "server/store/postgresql/held_task.h"
#include "server/store/postgresql/identity.h"
#include "server/store/postgresql/schema.h"
#include "tests/support/errors.h"
#include "tests/unit/store/cluster_fixture.h"

namespace isomesh::store::postgresql {
namespace {

using test::code_thrown_by;
using testing::IsEmpty;
using testing::SizeIs;

// --- Tables

TEST_F(ClusterTest, TablesOfANewerVersionAreRefused) {
  ask("UPDATE schema_versions SET version = 1000");
  EXPECT_EQ(code_thrown_by([&] { Database({.url = url_, .node = "x"}); }), ErrorCode::kUnavailable);
}

// Names of volumes have characters that it lacks.
TEST_F(ClusterTest, ADatabaseThatIsNotOfUtf8IsRefusedWithItsEncoding) {
  ask("CREATE DATABASE latin TEMPLATE template0 ENCODING 'LATIN1' LOCALE 'C'");
  std::string latin = url_.substr(0, url_.find("&options"));
  const std::string name = "///postgres?";
  latin.replace(latin.find(name), name.size(), "///latin?");
  const Error error = test::error_of([&] { Database({.url = latin, .node = "x"}); });
  EXPECT_EQ(error.code(), ErrorCode::kUnavailable);
  EXPECT_THAT(error.what(), testing::HasSubstr("LATIN1"));
}

// A large table takes longer than statements of a running daemon may.
TEST_F(ClusterTest, AnUpgradeMayTakeLongAndWaitsForWhoeverHoldsTheTables) {
  const Schema newer{.component = "trial",
                     .steps = {"ALTER TABLE jobs ADD COLUMN trial int NOT NULL DEFAULT 7"}};
  ask("CREATE FUNCTION check_patience() RETURNS trigger LANGUAGE plpgsql AS $$ BEGIN IF "
      "current_setting('statement_timeout')::interval < interval '10 minutes' THEN RAISE 'hurry'; "
      "END IF; RETURN new; END $$; CREATE TRIGGER patience BEFORE INSERT ON schema_versions FOR "
      "EACH ROW EXECUTE FUNCTION check_patience()");
  Connection connection(url_, Connection::Clock::now() + std::chrono::minutes(2));
  std::optional<Transaction> dump(std::in_place, connection);
  connection.query("SELECT count(*) FROM jobs");
  std::optional<ErrorCode> failure;
  std::jthread upgrading([&] {
    Connection own(url_);
    failure = code_thrown_by([&] { upgrade(own, schemas_with({order_tables(), newer})); });
  });
  const auto waits = [&] {
    return ask("SELECT count(*) FROM pg_locks WHERE NOT granted AND mode = 'AccessExclusiveLock' "
               "AND relation = 'jobs'::regclass") == "1";
  };
  EXPECT_TRUE(test::eventually(waits));
  EXPECT_TRUE(test::eventually([&] { return !waits(); })) << "running daemons have their turn";
  dump.reset();
  upgrading.join();
  EXPECT_FALSE(failure);
  submit();
  EXPECT_EQ(ask("SELECT trial FROM jobs"), "7");
}

TEST_F(ClusterTest, SeveralThatStartAtOnceMakeThemOnce) {
  const std::string place = Postgres::shared().new_place();
  std::vector<std::jthread> nodes;
  for (int n = 0; n < 6; ++n) {
    nodes.emplace_back([&, n] { Database({.url = place, .node = std::to_string(n)}); });
  }
  nodes.clear();
  EXPECT_EQ(Postgres::ask(place, "SELECT count(*) FROM nodes"), "6");
  EXPECT_EQ(Postgres::ask(place, "SELECT count(*) FROM schema_versions"), "1");
}

TEST_F(ClusterTest, TheAuditTrailIsNotChanged) {
  for (const std::string sql :
       {"UPDATE audit SET record = ''", "DELETE FROM audit", "TRUNCATE audit"}) {
    EXPECT_THROW(ask(sql), std::runtime_error) << sql;
  }
}

TEST_F(ClusterTest, WhoeverReadsTheAuditTrailChangesNothing) {
  AuditTrail(one().database).add({});
  const auto entries = [&] {
    return verify_trail(*connect_to_trail(url_, {order_tables()})).entries;
  };
  EXPECT_EQ(entries(), 1U);
  EXPECT_EQ(ask("SELECT count(*) FROM nodes"), "2");
  ask("UPDATE schema_versions SET version = 1000");
  EXPECT_EQ(code_thrown_by(entries), ErrorCode::kUnavailable);
  const std::string unused = Postgres::shared().new_place();
  EXPECT_EQ(code_thrown_by([&] { connect_to_trail(unused, {}); }), ErrorCode::kNotFound);
  EXPECT_EQ(
      Postgres::ask(unused, "SELECT count(*) FROM pg_tables WHERE schemaname = current_schema"),
      "0");
}

TEST_F(ClusterTest, TheAuditTrailTellsWhichEntryWasTamperedWith) {
  for (int n = 0; n < 5; ++n) AuditTrail((n % 2 ? one() : two()).database).add({});
  EXPECT_EQ(verify_trail(*connect_to_trail(url_, {order_tables()})).entries, 5U);
  ask("ALTER TABLE audit DISABLE TRIGGER audit_is_kept; UPDATE audit SET at = '' WHERE id = 3");
  EXPECT_EQ(verify_trail(*connect_to_trail(url_, {order_tables()})).misfit, 3U);
}

// --- What is not kept

TEST_F(ClusterTest, OneRemovesAtATime) {
  auto removal = one().jobs.claim_removal();
  EXPECT_TRUE(removal);
  EXPECT_FALSE(two().jobs.claim_removal());
  removal.reset();
  EXPECT_TRUE(two().jobs.claim_removal());
}

// The server notices only after a while that a connection has ended. Here it cannot for a while, as
// under load.
TEST_F(ClusterTest, WhoHasRemovedLetsOthersRemoveAtOnce) {
  auto removal = two().jobs.claim_removal();
  ASSERT_TRUE(removal);
  const int holder = std::stoi(
      ask("SELECT pid FROM pg_locks WHERE locktype = 'advisory' AND granted AND classid = "
          "(hashtext('isomesh removing')::bigint & 4294967295)::oid"));
  ASSERT_EQ(::kill(holder, SIGSTOP), 0);
  const std::jthread resume([holder] {
    std::this_thread::sleep_for(milliseconds(500));
    ::kill(holder, SIGCONT);
  });
  removal.reset();
  EXPECT_TRUE(one().jobs.claim_removal());
}

// The newest time that is known is 40 days later than the database's clock.
TEST_F(ClusterTest, WhatIsUsedIsNeverOlderThanTheNewestTimeThatIsKnown) {
  Identity(one().database, blobs_, {.adopt = true}, seconds(1)).now();
  ask("UPDATE identity SET seen = isomesh_now() + 40 * 86400000000");
  Volume volume;
  volume.id = "another";
  volume.samples = volume.id;
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

OrderSpec an_order() {
  OrderSpec order;
  order.record.order.id = "an order";
  order.record.order.created = "2024-01-01T00:00:00.000Z";
  return order;
}

OrderStore orders_of(Node& node, const HeldTask& task) {
  return OrderStore(node.database,
                    [&](SqlConnection& connection) { return task.is_ours(connection); });
}

TEST_F(ClusterTest, OneCarriesOutOrdersAtATime) {
  HeldTask second(two().database, "orders");
  {
    HeldTask first(one().database, "orders");
    EXPECT_EQ(first.keep(), "");
    EXPECT_THAT(second.keep(), testing::HasSubstr("another isomeshd"));
    EXPECT_EQ(first.keep(), "");
  }
  EXPECT_EQ(second.keep(), "") << "the first has ended";
}

// As after a restart of the database: a lock would be gone with its session.
TEST_F(ClusterTest, OrdersStayWithTheirHolderWhenItsConnectionsAreLost) {
  HeldTask first(one().database, "orders");
  HeldTask second(two().database, "orders");
  ASSERT_EQ(first.keep(), "");
  cut_connections();
  EXPECT_NE(second.keep(), "");
  EXPECT_EQ(first.keep(), "");
}

TEST_F(ClusterTest, WhoLostTheOrdersSavesNoStep) {
  SetClock clock;
  HeldTask first(one().database, "orders", {.now = clock.reader()});
  HeldTask second(two().database, "orders");
  ASSERT_EQ(first.keep(), "");
  OrderStore of_first = orders_of(one(), first);
  OrderStore of_second = orders_of(two(), second);
  OrderSpec order = an_order();
  // Who does not carry them out accepts them, too.
  ASSERT_EQ(of_second.submit(order, 1).kind, OrderSubmission::Kind::kNew);
  const Time now = std::chrono::system_clock::now();
  order.record.order.attempts = 1;
  EXPECT_TRUE(of_first.save(order.record, now));
  EXPECT_FALSE(of_second.save(order.record, now));
  ask("UPDATE tasks SET held_until = 0");
  EXPECT_TRUE(of_first.save(order.record, now)) << "nobody has taken them yet";
  ASSERT_EQ(second.keep(), "");
  order.record.order.attempts = 2;
  EXPECT_FALSE(of_first.save(order.record, now));
  EXPECT_EQ(of_second.get({}, order.record.order.id).attempts, 1U);
  EXPECT_TRUE(of_second.save(order.record, now));
  EXPECT_NE(first.keep(), "");
}

// In the data folder of the one that was killed there is one process at a time.
TEST_F(ClusterTest, ASuccessorOnTheSameDataFolderTakesTheOrdersAtOnce) {
  HeldTask first(one().database, "orders");
  ASSERT_EQ(first.keep(), "");
  Node again(url_, "one", blobs_);
  EXPECT_EQ(HeldTask(again.database, "orders").keep(), "");
}

TEST_F(ClusterTest, AHolderReliesOnTheOrdersForAPartOfTheLeaseWithoutTheDatabase) {
  SetClock clock;
  HeldTask task(one().database, "orders", {.now = clock.reader()});
  ASSERT_EQ(task.keep(), "");
  ask("ALTER TABLE tasks RENAME TO missing");
  EXPECT_EQ(task.keep(), "");
  clock.pass(seconds(20));
  EXPECT_NE(task.keep(), "");
  ask("ALTER TABLE missing RENAME TO tasks");
  EXPECT_EQ(task.keep(), "");
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
  one().outbox.remove(mine[0]);
  const auto theirs = two().outbox.due(now, 4);
  ASSERT_THAT(theirs, SizeIs(1));
  for (const Delivery& each : mine) EXPECT_NE(each.job, theirs[0].job);
  EXPECT_THAT(one().outbox.due(now, 4), SizeIs(3));
}

// --- Databases and blobs

// True if a daemon of that database starts with those blobs.
bool belong(Database& database, BlobStore& blobs, bool adopt = false) {
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
  FileBlobStore my_blobs(mine);
  FileBlobStore other_blobs(others);
  EXPECT_TRUE(belong(database, my_blobs));
  EXPECT_FALSE(belong(database, other_blobs));
  EXPECT_TRUE(belong(database, my_blobs));
}

// The store's URL is wrong, or nothing is mounted there.
TEST_F(ClusterTest, BlobsThatAreMissingAreMissed) {
  EXPECT_FALSE(belong(one().database, blobs_)) << "there are records, and no blobs";
  EXPECT_TRUE(belong(one().database, blobs_, true));
  EXPECT_TRUE(belong(two().database, blobs_));
}

}  // namespace
}  // namespace isomesh::store::postgresql
