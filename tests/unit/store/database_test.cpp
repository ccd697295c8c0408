#include "server/store/sqlite/database.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "server/store/sql/audit_trail.h"
#include "server/store/sql/volume_store.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"

namespace isomesh::store {
namespace {

class DatabaseTest : public testing::Test {
 protected:
  test::TemporaryFolder folder_;
  DataFolder data_{folder_ / "data"};
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

TEST_F(DatabaseTest, OfANewerVersionIsRefusedAndLeftAsItIs) {
  { const Database database(data_); }
  { Connection(data_.records(), Connection::Mode::kWrite).script("PRAGMA user_version=99"); }
  const auto error = test::thrown_by([&] { Database database(data_); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), ErrorCode::kUnavailable);
  EXPECT_THAT(error->what(), testing::HasSubstr("newer"));
  EXPECT_THAT(error->what(), testing::HasSubstr("99"));
}

// Its tables are not those that this version's statements are for.
TEST_F(DatabaseTest, OfAVersionThatWasNeverReleasedIsRefused) {
  { const Database database(data_); }
  { Connection(data_.records(), Connection::Mode::kWrite).script("PRAGMA user_version=2"); }
  const auto error = test::thrown_by([&] { Database database(data_); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), ErrorCode::kUnavailable);
  EXPECT_THAT(error->what(), testing::HasSubstr("a pre-release isomeshd"));
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

// Whose volumes have their labels in the record that is listed.
TEST_F(DatabaseTest, OfTheVersionBeforeKeepsItsVolumesWithTheirLabels) {
  Volume plain;
  plain.id = "aa";
  plain.created = "2024-01-02T03:04:05.678Z";
  Volume labelled = plain;
  labelled.id = "bb";
  labelled.labels = {{3, "\"labels\":["}, {4, "four"}};
  {
    Database database(data_);
    SqlVolumeStore volumes(database);
    volumes.add("", plain);
    volumes.add("", labelled);
  }
  Connection(data_.records(), Connection::Mode::kWrite)
      .script(
          "UPDATE volumes SET record = coalesce(labelled, record); DROP INDEX volumes_by_time; "
          "ALTER TABLE volumes DROP COLUMN labelled; PRAGMA user_version=6");
  Database database(data_);
  const SqlVolumeStore volumes(database);
  EXPECT_EQ(volumes.get("", "aa"), plain);
  EXPECT_EQ(volumes.get("", "bb"), labelled);
  labelled.labels.clear();
  EXPECT_THAT(volumes.list("", "", 10, ListOrder::kOldestFirst),
              testing::ElementsAre(plain, labelled));
}

// Not even by whoever has the file open.
TEST_F(DatabaseTest, TheAuditTrailIsNeitherChangedNorRemoved) {
  Database database(data_);
  SqlAuditTrail(database).add({.event = AuditEvent::kStart});
  for (const char* sql : {"UPDATE audit SET record = ''", "DELETE FROM audit"}) {
    EXPECT_EQ(test::code_thrown_by([&] {
                Transaction transaction(database.writer());
                transaction->run(sql);
                transaction.commit();
              }),
              ErrorCode::kInternal)
        << sql;
  }
}

TEST_F(DatabaseTest, ThatIsNoneIsRefusedWithoutItsPath) {
  test::write_file(data_.records(), std::string(5000, 'x'));
  const auto error = test::thrown_by([&] { Database database(data_); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), ErrorCode::kInternal);
  EXPECT_EQ(std::string(error->what()).find(folder_.path()), std::string::npos);
}

TEST(Timestamps, AreReadBack) {
  EXPECT_EQ(us_of_timestamp("1970-01-01T00:00:01.250Z"), 1'250'000);
  EXPECT_EQ(us_of_timestamp("2024-01-02T03:04:05.678Z"), 1'704'164'645'678'000);
  EXPECT_EQ(us_of_timestamp("yesterday"), 0);
}

}  // namespace
}  // namespace isomesh::store
