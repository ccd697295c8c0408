#include "server/store/sqlite/identity.h"

#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/store/files/blob_store.h"
#include "server/store/sql/volume_store.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"
#include "tests/support/stores.h"

namespace isomesh::store {
namespace {

using testing::HasSubstr;

class IdentityTest : public testing::Test {
 protected:
  // A start of the service, which stores a volume of those bytes, marks it and ends.
  void live(const std::string& bytes, const OperatorOverrides& overrides = {}) {
    const DataFolder data(root());
    Database database(data);
    FileBlobStore blobs(data);
    Identity identity(database, blobs, overrides, {});
    if (!bytes.empty()) {
      Volume volume;
      volume.id = test::put(blobs, bytes).key;
      volume.samples = volume.id;
      volume.created = "2024-01-02T03:04:05.678Z";
      SqlVolumeStore(database).add("", volume);
    }
    identity.now();
  }

  std::string refusal() {
    const auto error = test::thrown_by([&] { live(""); });
    if (!error) return "";
    EXPECT_EQ(error->code(), ErrorCode::kUnavailable);
    EXPECT_THAT(error->what(), HasSubstr("--adopt"));
    EXPECT_EQ(std::string(error->what()).find(folder_.path()), std::string::npos);
    return error->what();
  }

  std::filesystem::path root() const { return folder_ / "data"; }

  void copy(const std::string& from, const std::string& to) {
    std::filesystem::remove_all(folder_ / to);
    std::filesystem::copy(folder_ / from, folder_ / to, std::filesystem::copy_options::recursive);
  }

  void remove_database() {
    for (const auto* suffix : {"", "-wal", "-shm"}) {
      std::filesystem::remove(root() / ("isomesh.sqlite" + std::string(suffix)));
    }
  }

  test::TemporaryFolder folder_;
};

TEST_F(IdentityTest, IsKeptFromStartToStart) {
  for (int start = 0; start < 4; ++start) live(std::to_string(start));
  EXPECT_EQ(refusal(), "");
}

// Jobs that such a start accepted would be missing in the database they were moved to.
TEST_F(IdentityTest, RecordsThatWereMovedAreRefusedUntilTheyAreAdopted) {
  live("a volume");
  {
    const DataFolder data(root());
    Database database(data);
    mark_as_moved(database, "of the blobs");
  }
  EXPECT_THAT(refusal(), HasSubstr("--store"));
  EXPECT_THAT(refusal(), HasSubstr("isomeshd move"));
  live("", {.adopt = true});
  EXPECT_EQ(refusal(), "");
}

TEST_F(IdentityTest, RecordsWithoutAMarkThatWereMovedAreRefused) {
  {
    const DataFolder data(root());
    Database database(data);
    mark_as_moved(database, "of the blobs");
  }
  EXPECT_THAT(refusal(), HasSubstr("--store"));
}

TEST_F(IdentityTest, OfAnEmptyFolderIsMadeAnew) {
  live("");
  remove_database();
  EXPECT_EQ(refusal(), "");
}

TEST_F(IdentityTest, AMissingDatabaseIsRefused) {
  live("a volume");
  remove_database();
  EXPECT_THAT(refusal(), HasSubstr("missing"));
  EXPECT_THAT(refusal(), HasSubstr("missing")) << "the refused start has made none of its own";
}

TEST_F(IdentityTest, AnOlderDatabaseIsRefused) {
  live("one");
  copy("data", "copy");
  live("two");
  remove_database();
  copy("copy/isomesh.sqlite", "data/isomesh.sqlite");
  EXPECT_THAT(refusal(), HasSubstr("older than the files"));
}

TEST_F(IdentityTest, OlderBlobsAreRefused) {
  live("one");
  copy("data/blobs", "copy");
  live("two");
  live("three");
  copy("copy", "data/blobs");
  EXPECT_THAT(refusal(), HasSubstr("older than the database"));
}

TEST_F(IdentityTest, AForeignDatabaseIsRefused) {
  live("one");
  copy("data", "copy");
  std::filesystem::remove_all(root());
  live("two");
  copy("copy/blobs", "data/blobs");
  EXPECT_THAT(refusal(), HasSubstr("do not belong together"));
}

TEST_F(IdentityTest, AnOperatorMayAdoptWhatIsThere) {
  live("a volume");
  remove_database();
  live("", {.adopt = true});
  EXPECT_EQ(refusal(), "");
}

// Between the database's mark and the blobs'.
TEST_F(IdentityTest, AStartThatWasCutShortIsNoMixUp) {
  live("one");
  copy("data/blobs", "copy");
  {
    const DataFolder data(root());
    Database database(data);
    Connection& writer = database.writer();
    Transaction transaction(writer);
    transaction->run("UPDATE identity SET number = number + 1");
    transaction.commit();
  }
  EXPECT_EQ(refusal(), "");
}

TEST_F(IdentityTest, RemembersTheTimeThatItHasSeen) {
  live("one");
  {
    const DataFolder data(root());
    Connection(data.records(), Connection::Mode::kWrite)
        .script("UPDATE identity SET seen = seen - 3456000000000");  // 40 days
  }
  const DataFolder data(root());
  Database database(data);
  FileBlobStore blobs(data);
  const auto now = std::chrono::system_clock::now();
  {
    Identity identity(database, blobs, {}, {});
    EXPECT_LT(identity.now(), now - std::chrono::days(39));
  }
  {
    Identity again(database, blobs, {}, {});
    EXPECT_LT(again.now(), now - std::chrono::days(39)) << "a doubtful time is never marked";
  }
  Identity told(database, blobs, {.trust_clock = true}, {});
  EXPECT_GE(told.now(), now);
}

// Both have nothing yet; the second would sweep what the first stores.
TEST_F(IdentityTest, ASharedStoreIsOneDatabasesFromTheBeginning) {
  std::filesystem::create_directory(folder_ / "shared");
  const auto start = [&](const std::string& name, const OperatorOverrides& overrides) {
    const DataFolder data(folder_ / name);
    Database database(data);
    FileBlobStore blobs(shared_blob_folders(folder_ / "shared"), data.reserve());
    Identity(database, blobs, overrides, {}).now();
  };
  start("one", {});
  start("one", {});
  const Error error = test::error_of([&] { start("two", {}); });
  EXPECT_THAT(error.what(), HasSubstr("another database"));
  start("two", {.adopt = true});
}

}  // namespace
}  // namespace isomesh::store
