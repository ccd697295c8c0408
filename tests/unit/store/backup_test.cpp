#include "server/store/sqlite/backup.h"

#include <filesystem>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/ids.h"
#include "server/hospital/records/order_store.h"
#include "server/hospital/records/received_store.h"
#include "server/hospital/records/tables.h"
#include "server/store/files/blob_store.h"
#include "server/store/sqlite/database.h"
#include "server/store/sqlite/identity.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"
#include "tests/support/stores.h"

namespace isomesh::store {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

// A data folder with an image that a peer has sent and an object that an order is about to send.
class BackupOfAHospitalTest : public testing::Test {
 protected:
  BackupOfAHospitalTest() {
    const DataFolder data(root());
    Database database(data, {order_tables()});
    FileBlobStore blobs(data);
    image_ = test::put(blobs, "an image").key;
    ReceivedStore(database).add({"BONE", "1.2", "1.3"},
                                {.instance = "1.3.1", .blob = image_, .bytes = 8});
    object_ = test::put(blobs, "an object").key;
    OrderStore orders(database);
    OrderSpec spec;
    spec.record.order.id = order_;
    spec.record.order.source = {.pacs = "main", .study = "1.2", .series = "1.3"};
    spec.record.order.created = "2024-01-02T03:04:05.678Z";
    spec.record.work.begun = spec.record.order.created;
    orders.submit(spec, 1);
    spec.record.order.state = OrderState::kSending;
    spec.record.work.blobs = {object_};
    EXPECT_TRUE(orders.save(spec.record, {}));
  }

  std::filesystem::path root() const { return folder_ / "data"; }
  std::filesystem::path blob(const std::string& in, const std::string& key) const {
    return folder_ / in / "blobs" / key.substr(0, 2) / key;
  }

  test::TemporaryFolder folder_;
  const std::string order_ = time_ordered_id();
  std::string image_;
  std::string object_;
};

TEST_F(BackupOfAHospitalTest, HasWhatWasReceivedAndWhatIsToBeSent) {
  const Copied copied = back_up(root(), folder_ / "backup");
  EXPECT_EQ(copied.blobs, 2U);
  EXPECT_THAT(copied.missing, IsEmpty());
  EXPECT_EQ(restore(folder_ / "backup", folder_ / "restored", {order_tables()}), copied);
  EXPECT_EQ(test::read_file(blob("restored", image_)), "an image");
  EXPECT_EQ(test::read_file(blob("restored", object_)), "an object");
}

// They would be old ones, and look like a good backup.
TEST_F(BackupOfAHospitalTest, OfRecordsThatWereMovedIsRefused) {
  {
    const DataFolder data(root());
    Database database(data, {order_tables()});
    mark_as_moved(database, "of the blobs");
  }
  const Error error = test::error_of([&] { back_up(root(), folder_ / "backup"); });
  EXPECT_EQ(error.code(), ErrorCode::kUnavailable);
  EXPECT_THAT(error.what(), HasSubstr("--store"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "backup"));
}

TEST_F(BackupOfAHospitalTest, SaysWhichOfThemIsDamagedOrMissing) {
  std::filesystem::remove(blob("data", image_));
  test::write_file(blob("data", object_), "spoilt");
  const Copied copied = back_up(root(), folder_ / "backup");
  EXPECT_THAT(copied.missing, ElementsAre("the received image 1.3.1"));
  EXPECT_THAT(copied.damaged, ElementsAre("an object of the order " + order_));
}

// A daemon would not start with it.
TEST_F(BackupOfAHospitalTest, OfANewerVersionIsNotRestored) {
  back_up(root(), folder_ / "backup");
  Connection(folder_ / "backup/isomesh.sqlite", Connection::Mode::kWrite)
      .script("UPDATE schema_versions SET version = 99");
  const auto error =
      test::thrown_by([&] { restore(folder_ / "backup", folder_ / "restored", {order_tables()}); });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), ErrorCode::kUnavailable);
  EXPECT_THAT(error->what(), HasSubstr("a newer isomeshd"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "restored"));
}

}  // namespace
}  // namespace isomesh::store
