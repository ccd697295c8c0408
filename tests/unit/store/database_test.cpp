#include "server/store/sqlite/database.h"

#include <filesystem>
#include <optional>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "server/store/audit/trail.h"
#include "server/store/sql/job_list.h"
#include "server/store/sql/volume_store.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"

namespace isomesh::store {
namespace {

using testing::HasSubstr;
using testing::Not;

class DatabaseTest : public testing::Test {
 protected:
  test::TemporaryFolder folder_;
  DataFolder data_{folder_ / "data", std::uint64_t{1} << 20};
};

TEST_F(DatabaseTest, IsForItsOwnerOnly) {
  const Database database(data_);
  for (const auto* suffix : {"", "-wal", "-shm"}) {
    struct stat status = {};
    ASSERT_EQ(::stat((data_.records().string() + suffix).c_str(), &status), 0) << suffix;
    EXPECT_EQ(status.st_mode & 0777, 0600U) << suffix;
  }
}

// Whoever reads much holds nobody up. With one connection the second reading would wait for ever.
TEST_F(DatabaseTest, ReadersReadSideBySide) {
  Database database(data_);
  SqlVolumeStore volumes(database);
  const Reading much(database.reader());
  const Reading more(database.reader());
  EXPECT_TRUE(volumes.list(std::nullopt, "", 10, ListOrder::kOldestFirst).empty());
}

// As on a disk that became read-only.
TEST_F(DatabaseTest, AnErrorOfADiskThatIsMissingMayPass) {
  { const Database database(data_); }
  Connection connection(data_.records(), Connection::Mode::kRead);
  const auto code = [&] {
    return test::code_thrown_by([&] { connection.run("DELETE FROM volumes"); });
  };
  EXPECT_EQ(code(), ErrorCode::kInternal);
  bool responds = true;
  connection.know_disk([&] { return responds; });
  EXPECT_EQ(code(), ErrorCode::kInternal);
  responds = false;
  EXPECT_EQ(code(), ErrorCode::kUnavailable);
}

// The one that was opened in its place is closed later.
TEST_F(DatabaseTest, ThatIsAwayRemovesNoFileOfAnotherAtItsEnd) {
  const std::filesystem::path place = folder_ / "place";
  std::optional<DataFolder> folder(std::in_place, place);
  std::optional<Database> database(std::in_place, *folder);
  std::filesystem::rename(place, folder_ / "away");
  const DataFolder other(place);
  Database others(other);
  Volume volume;
  volume.id = "abc";
  SqlVolumeStore(others).add("", volume);
  database.reset();
  EXPECT_TRUE(std::filesystem::exists(place / "isomesh.sqlite-wal"));
  EXPECT_TRUE(std::filesystem::exists(place / "isomesh.sqlite-shm"));
  // At its place again, it closes as usual.
  std::filesystem::rename(place, folder_ / "others");
  std::filesystem::rename(folder_ / "away", place);
  database.emplace(*folder);
  database.reset();
  EXPECT_FALSE(std::filesystem::exists(place / "isomesh.sqlite-wal"));
}

TEST_F(DatabaseTest, IsOpenedAgainAsItWas) {
  Volume volume;
  volume.id = "aa";
  volume.format = "nrrd";
  volume.created = "2024-01-02T03:04:05.678Z";
  {
    Database database(data_);
    SqlVolumeStore(database).add("", volume);
  }
  Database again(data_);
  EXPECT_EQ(SqlVolumeStore(again).get("", "aa"), volume);
}

// Otherwise a list of few among many jobs would read all of them.
TEST_F(DatabaseTest, ListsOfJobsReadByIndexes) {
  Database database(data_);
  const auto plan = [&](const Viewer& viewer, const JobFilter& filter) {
    const JobListValues values(filter);
    Rows rows = database.query(
        "EXPLAIN QUERY PLAN SELECT j.record FROM jobs j " + job_list_query(viewer, filter, ""),
        viewer, filter.state, "", 10, values.volume, values.since, values.until, values.first_id);
    std::string text;
    while (rows.next()) text += rows.text(3) + '\n';
    EXPECT_THAT(text, Not(HasSubstr("TEMP B-TREE")));
    return text;
  };
  const Time time = std::chrono::system_clock::now();
  EXPECT_THAT(plan("", {}), HasSubstr("INDEX jobs_by_owner (owner=?)"));
  EXPECT_THAT(plan("", {.volume = "v"}), HasSubstr("INDEX jobs_of_volume (owner=? AND volume=?)"));
  EXPECT_THAT(plan({}, {.volume = "v"}), HasSubstr("INDEX jobs_on_volume (volume=?)"));
  EXPECT_THAT(plan("", {.since = time}), HasSubstr("INDEX jobs_by_owner (owner=? AND id>?)"));
  EXPECT_THAT(plan({}, {.since = time}), HasSubstr("SEARCH j USING PRIMARY KEY (id>?)"));
  const std::string until = plan("", {.until = time});
  EXPECT_THAT(until, HasSubstr("INDEX jobs_by_owner (owner=? AND id<?)"));
  EXPECT_THAT(until, HasSubstr("SEARCH x USING COVERING INDEX jobs_by_owner (owner=?)"));
  const std::string of_all = plan({}, {.until = time});
  EXPECT_THAT(of_all, HasSubstr("SEARCH j USING PRIMARY KEY (id<?)"));
  EXPECT_THAT(of_all, HasSubstr("SCAN x USING COVERING INDEX jobs_by_time"));
}

// --- Versions of tables

Schema trial(int version) {
  Schema schema{.component = "trial",
                .steps = {"CREATE TABLE trials(id {key} NOT NULL PRIMARY KEY){by_key}; INSERT INTO "
                          "trials VALUES('old')",
                          "ALTER TABLE trials ADD COLUMN blob TEXT; UPDATE trials SET blob = 'aa'"},
                .named_blobs = "SELECT blob, 'the trial ' AS what, id AS name FROM trials"};
  if (version == 1) schema = {.component = "trial", .steps = {schema.steps.front()}};
  return schema;
}

TEST_F(DatabaseTest, OfAnOlderVersionIsUpgradedAndKeepsItsRows) {
  { const Database database(data_, {trial(1)}); }
  for (const bool is_upgraded : {false, true}) {
    Database database(data_, {trial(2)});
    EXPECT_TRUE(SqlVolumeStore(database).names("aa")) << "opened again: " << is_upgraded;
    EXPECT_FALSE(SqlVolumeStore(database).names("bb"));
    Rows row = database.query("SELECT id FROM trials WHERE blob = 'aa'");
    ASSERT_TRUE(row.next());
    EXPECT_EQ(row.text(0), "old");
  }
}

TEST_F(DatabaseTest, GetsTheTablesOfAComponentThatItLacked) {
  { const Database database(data_); }
  Database database(data_, {trial(2)});
  EXPECT_TRUE(SqlVolumeStore(database).names("aa"));
}

TEST_F(DatabaseTest, OfANewerVersionOrAnUnknownComponentIsRefused) {
  { const Database database(data_, {trial(2)}); }
  const Error newer = test::error_of([&] { Database database(data_, {trial(1)}); });
  EXPECT_EQ(newer.code(), ErrorCode::kUnavailable);
  EXPECT_THAT(newer.what(),
              testing::HasSubstr("have version 2, this isomeshd reads versions 1 to 1"));
  const Error unknown = test::error_of([&] { Database database(data_); });
  EXPECT_EQ(unknown.code(), ErrorCode::kUnavailable);
  EXPECT_THAT(unknown.what(), testing::HasSubstr("was built without: trial"));
}

TEST_F(DatabaseTest, WithTablesOfAnotherProgramIsRefused) {
  {
    Connection connection(data_.records(), Connection::Mode::kWrite);
    connection.run("CREATE TABLE volumes(title TEXT)");
  }
  const Error refused = test::error_of([&] { Database database(data_); });
  EXPECT_EQ(refused.code(), ErrorCode::kUnavailable);
  EXPECT_THAT(refused.what(), testing::HasSubstr("has tables of another program"));
}

// An upgrade that fails changes nothing.
TEST_F(DatabaseTest, ThatCannotBeUpgradedStaysAsItWas) {
  { const Database database(data_, {trial(1)}); }
  Schema wrong = trial(1);
  wrong.steps.insert(wrong.steps.end(), {"DELETE FROM trials", "UPDATE nothing SET a = 1"});
  EXPECT_EQ(test::code_thrown_by([&] { Database database(data_, {wrong}); }), ErrorCode::kInternal);
  Database database(data_, {trial(2)});
  EXPECT_TRUE(SqlVolumeStore(database).names("aa"));
}

// --- The audit trail

// Not even by whoever has the file open.
TEST_F(DatabaseTest, TheAuditTrailIsNeitherChangedNorRemoved) {
  Database database(data_);
  AuditTrail(database).add({.event = AuditEvent::kStart});
  for (const char* sql :
       {"UPDATE audit SET record = ''", "DELETE FROM audit",
        "INSERT OR REPLACE INTO audit(id, at, record, chain) VALUES(1, '', '{}', '')",
        "REPLACE INTO audit SELECT * FROM audit", "UPDATE OR REPLACE audit SET id = 1"}) {
    EXPECT_EQ(test::code_thrown_by([&] {
                Transaction transaction(database.writer());
                transaction->run(sql);
                transaction.commit();
              }),
              ErrorCode::kInternal)
        << sql;
  }
}

// All members of a group commit fail together, and one of them is first.
TEST_F(DatabaseTest, WhatFreesSpaceIsTriedAgainAlsoIfAnotherThreadReleasedTheReserve) {
  Database database(data_);
  data_.reserve().let_go();
  int runs = 0;
  database.freeing([&] {
    if (++runs == 1) throw Error(ErrorCode::kOutOfSpace, "full");
  });
  EXPECT_EQ(runs, 2);
}

// By who removes the triggers first.
TEST_F(DatabaseTest, TheAuditTrailTellsWhichEntryWasTamperedWith) {
  const auto add = [this](int count) {
    Database database(data_);
    for (int n = 0; n < count; ++n) {
      AuditTrail(database).add({.event = AuditEvent::kQuery, .study = std::to_string(n)});
    }
  };
  const auto tamper = [this](const std::string& sql) {
    Connection connection(data_.records(), Connection::Mode::kWrite);
    connection.script(
        "DROP TRIGGER IF EXISTS audit_is_not_changed; DROP TRIGGER IF EXISTS audit_is_not_removed; "
        "DROP TRIGGER IF EXISTS audit_is_not_replaced;");
    connection.script(sql);
  };
  const auto check = [this] {
    Connection connection(data_.records(), Connection::Mode::kRead);
    return verify_trail(connection);
  };
  { const Database database(data_); }
  EXPECT_EQ(check().entries, 0U);
  add(1203);  // more than are read at once
  const AuditCheck intact = check();
  EXPECT_EQ(intact.misfit, std::nullopt);
  EXPECT_EQ(intact.entries, 1203U);
  EXPECT_EQ(intact.last, 1203U);
  tamper("UPDATE audit SET chain = chain");
  EXPECT_EQ(check().digest, intact.digest);
  const auto kept = test::read_file(data_.records());
  using Case = std::pair<const char*, std::uint64_t>;
  for (const auto& [sql, misfit] :
       {Case{"UPDATE audit SET record = replace(record, '\"7\"', '\"8\"') WHERE id = 8", 8},
        Case{"UPDATE audit SET at = '2024-01-01T00:00:00.000Z' WHERE id = 700", 700},
        Case{"DELETE FROM audit WHERE id = 600", 601}, Case{"DELETE FROM audit WHERE id < 50", 50},
        Case{"UPDATE audit SET record = '{}' WHERE id = 2", 2},
        Case{"UPDATE audit SET chain = '' WHERE id = 1203", 1203},
        Case{"INSERT INTO audit(id, at, record, chain) VALUES(9999, '', '{}', '')", 9999}}) {
    tamper(sql);
    EXPECT_EQ(check().misfit, misfit) << sql;
    test::write_file(data_.records(), kept);
  }
  EXPECT_EQ(check().digest, intact.digest);
}

TEST_F(DatabaseTest, ThatIsNoneIsRefusedWithoutItsPath) {
  test::write_file(data_.records(), std::string(5000, 'x'));
  const Error error = test::error_of([&] { Database database(data_); });
  EXPECT_EQ(error.code(), ErrorCode::kInternal);
  EXPECT_EQ(std::string(error.what()).find(folder_.path()), std::string::npos);
}

TEST(Timestamps, AreReadBack) {
  EXPECT_EQ(us_of_timestamp("1970-01-01T00:00:01.250Z"), 1'250'000);
  EXPECT_EQ(us_of_timestamp("2024-01-02T03:04:05.678Z"), 1'704'164'645'678'000);
  EXPECT_EQ(us_of_timestamp("yesterday"), 0);
}

}  // namespace
}  // namespace isomesh::store
