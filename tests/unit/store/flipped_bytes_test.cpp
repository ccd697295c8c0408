// One wrong byte in the file of SQLite's database, in the cell of a record.
#include <algorithm>
#include <chrono>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/clock.h"
#include "base/log.h"
#include "proto/json.h"
#include "server/hospital/records/order_store.h"
#include "server/hospital/records/tables.h"
#include "server/store/files/blob_store.h"
#include "server/store/job_rules.h"
#include "server/store/sql/outbox.h"
#include "server/store/sql/undamaged_rows.h"
#include "server/store/sql/volume_store.h"
#include "server/store/sqlite/database.h"
#include "server/store/sqlite/identity.h"
#include "server/store/sqlite/job_store.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"

namespace isomesh::store {
namespace {

// Before a row's key in its cell are its length and the types of its columns.
constexpr std::size_t kHeaderBytes = 16;

// The part of a long record that is tried. SQLite moves the end of a row above 1002 bytes to
// another page.
constexpr std::size_t kOnItsPage = 200;

class FlippedBytes : public testing::Test {
 protected:
  static constexpr std::size_t kRows = 5;

  FlippedBytes() {
    Database database(data_, {order_tables()});
    SqlVolumeStore volumes(database);
    for (std::size_t n = 0; n < kRows; ++n) volumes.add("", volume(n));
    FileBlobStore blobs(data_);
    SqliteJobStore jobs(database, blobs, {});
    for (std::size_t n = 0; n < kRows; ++n) {
      JobParameters parameters;
      parameters.volume = volume(n).id;
      jobs_.push_back(job_of(jobs.submit({"", parameters, "", ""})).id);
    }
  }

  static Volume volume(std::size_t number) {
    Volume volume;
    // Short names: SQLite keeps what is longer than a quarter of a page in another page.
    volume.id = "volume-" + std::string(20, static_cast<char>('a' + number));
    volume.samples = "samples-" + std::string(20, static_cast<char>('a' + number));
    volume.created = "2024-01-01T00:00:0" + std::to_string(number) + ".000Z";
    return volume;
  }

  // Calls `check(database, offset)` with each byte of the row wrong in turn, but for those of its
  // key. By the key, and the header before it, SQLite finds the way to other rows.
  template <class Check>
  void for_each_flip(const std::string& key, const std::string& record, const Check& check) {
    const std::string whole = test::read_file(data_.records());
    const std::size_t found = whole.find(record);
    ASSERT_NE(found, std::string::npos) << record;
    const std::size_t end = found + record.size();
    const std::size_t begin = whole.rfind(key, end - record.size());
    ASSERT_NE(begin, std::string::npos);
    for (std::size_t at = begin - kHeaderBytes; at < end; ++at) {
      if (at == begin) at += key.size();
      for (const int flip : {0x01, 0x80}) {
        std::string flipped = whole;
        flipped[at] = static_cast<char>(flipped[at] ^ flip);
        test::write_file(data_.records(), flipped);
        Database database(data_, {order_tables()});
        check(database, at - begin + kHeaderBytes);
      }
      // Most of a record is alike.
      if (at > begin + key.size() + kHeaderBytes) at += 6;
    }
    test::write_file(data_.records(), whole);
  }

  // The same, with `find(database)`, the number of rows that are found in spite of that. Only the
  // row itself may be missing.
  template <class Find>
  void expect_others_found(const std::string& key, const std::string& record, const Find& find) {
    std::size_t hidden = 0;
    for_each_flip(key, record, [&](Database& database, std::size_t offset) {
      const std::size_t found = find(database);
      hidden += found < kRows ? 1 : 0;
      EXPECT_GE(found, least_of(offset)) << offset;
    });
    EXPECT_GT(hidden, 0U) << "the flips damage a record";
  }

  // Makes a table or an index of few rows unreadable.
  void damage_table(const std::string& name) {
    std::size_t page = 0;
    std::size_t bytes = 0;
    {
      Database database(data_, {order_tables()});
      Rows root = database.query("SELECT rootpage FROM sqlite_schema WHERE name = ?1", name);
      ASSERT_TRUE(root.next());
      page = root.count(0);
      Rows size = database.query("PRAGMA page_size");
      ASSERT_TRUE(size.next());
      bytes = size.count(0);
    }
    std::string file = test::read_file(data_.records());
    file.replace((page - 1) * bytes, 8, 8, '\xff');
    test::write_file(data_.records(), file);
  }

  // How many rows are found whatever the byte at that offset is.
  static std::size_t least_of(std::size_t offset) { return offset < kHeaderBytes ? 0 : kRows - 1; }

  test::TemporaryFolder folder_{test::fast_place()};
  DataFolder data_{folder_ / "data"};
  std::vector<std::string> jobs_;
};

TEST_F(FlippedBytes, OfAVolumeHideNoOther) {
  expect_others_found(volume(2).id, to_record(volume(2)), [](Database& database) {
    const SqlVolumeStore volumes(database);
    const auto listed = [&](ListOrder order) { return volumes.list("", "", 9, order).size(); };
    return std::min(listed(ListOrder::kOldestFirst), listed(ListOrder::kNewestFirst));
  });
}

TEST_F(FlippedBytes, OfAJobHideNoOtherAndDoNotStopTheQueue) {
  std::string record;
  {
    Database database(data_, {order_tables()});
    FileBlobStore blobs(data_);
    record = to_record(SqliteJobStore(database, blobs, {}).get("", jobs_[2]));
  }
  expect_others_found(jobs_[2], record, [&](Database& database) {
    FileBlobStore blobs(data_);
    SqliteJobStore jobs(database, blobs, {});
    const std::size_t listed = jobs.list("", {}, "", 9).size();
    // The first claim that meets an unreadable row fails, and no later one.
    std::size_t claimed = 0;
    for (std::size_t n = 0; n < kRows + 3; ++n) {
      try {
        claimed += jobs.claim("worker", std::chrono::hours(1)) ? 1 : 0;
      } catch (const Error& error) {
        EXPECT_EQ(error.code(), ErrorCode::kInternal);
      }
    }
    return std::min(listed, claimed);
  });
}

// Also if the damage is before any row that is asked for, from both ends.
TEST_F(FlippedBytes, HideNothingFromWhoHasNothing) {
  constexpr DamagedTable kTable = {"volumes", "SELECT record FROM volumes", "owner, id",
                                   "owner DESC, id DESC"};
  const std::string query = "SELECT record FROM volumes WHERE record = 'of nobody'";
  std::size_t unreadable = 0;
  for_each_flip(volume(2).id, to_record(volume(2)), [&](Database& database, std::size_t offset) {
    try {
      database.query(query);
    } catch (const Error&) {
      ++unreadable;
    }
    EXPECT_NO_THROW(read_undamaged(database, kTable, query, [](const Rows&) {})) << offset;
  });
  EXPECT_GT(unreadable, 0U);
}

TEST_F(FlippedBytes, OfAWholeTableAreNoEmptyList) {
  damage_table("volumes");
  Database database(data_, {order_tables()});
  const SqlVolumeStore volumes(database);
  EXPECT_EQ(test::code_thrown_by([&] { volumes.list("", "", 9, ListOrder::kOldestFirst); }),
            ErrorCode::kInternal);
}

TEST_F(FlippedBytes, BesideTheQueueAreNotBlamedOnItsJobs) {
  damage_table("events_by_job");
  Database database(data_, {order_tables()});
  FileBlobStore blobs(data_);
  SqliteJobStore jobs(database, blobs, {});
  start_log(LogFormat::kText, LogLevel::kInfo);
  testing::internal::CaptureStderr();
  for (std::size_t n = 0; n < kRows; ++n) {
    EXPECT_EQ(test::code_thrown_by([&] { jobs.claim("worker", std::chrono::hours(1)); }),
              ErrorCode::kInternal);
  }
  const std::string log = testing::internal::GetCapturedStderr();
  start_log(LogFormat::kText, LogLevel::kOff);
  for (const std::string& id : jobs_) EXPECT_THAT(log, testing::Not(testing::HasSubstr(id)));
}

TEST_F(FlippedBytes, OfARunningJobLeaveNoOtherWithoutAnEnd) {
  std::string record;
  {
    Database database(data_, {order_tables()});
    FileBlobStore blobs(data_);
    SqliteJobStore jobs(database, blobs, {});
    for (std::size_t n = 0; n < kRows; ++n) {
      ASSERT_TRUE(jobs.claim("worker", std::chrono::hours(1)));
    }
    Rows row = database.query("SELECT record FROM jobs WHERE id = ?1", jobs_[2]);
    ASSERT_TRUE(row.next());
    record = row.text(0).substr(0, kOnItsPage);
  }
  expect_others_found(jobs_[2], record, [&](Database& database) {
    FileBlobStore blobs(data_);
    try {
      return SqliteJobStore(database, blobs, {}).reap();
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kInternal);
      return std::size_t{0};
    }
  });
}

TEST_F(FlippedBytes, OfACallbackStopNoOther) {
  const auto body = [](std::size_t n) { return "{\"number\":" + std::to_string(n) + "}"; };
  {
    Database database(data_, {order_tables()});
    database.change(Change::kNeeded, [&](SqlTransaction& transaction) {
      for (std::size_t n = 0; n < kRows; ++n) {
        add_callback(transaction.connection(), jobs_[n], "http://localhost/", body(n));
      }
      transaction.commit();
    });
  }
  expect_others_found(jobs_[2], body(2), [&](Database& database) {
    const Time later = std::chrono::system_clock::now() + std::chrono::hours(1);
    return SqlOutbox(database).due(later, 9).size();
  });
}

TEST_F(FlippedBytes, OfAnOrderStopNoOther) {
  std::vector<OrderSpec> specs(kRows);
  {
    Database database(data_, {order_tables()});
    OrderStore orders(database);
    for (std::size_t n = 0; n < kRows; ++n) {
      Order& order = specs[n].record.order;
      order.id = "order-" + std::string(8, static_cast<char>('a' + n));
      order.created = "2024-01-01T00:00:00.000Z";
      specs[n].record.work.begun = order.created;
      orders.submit(specs[n], kRows);
    }
  }
  const Order& flipped = specs[2].record.order;
  const std::string record = to_record(flipped).substr(0, kOnItsPage);
  std::size_t hidden = 0;
  for_each_flip(flipped.id, record, [&](Database& database, std::size_t offset) {
    const Time later = std::chrono::system_clock::now() + std::chrono::hours(1);
    const std::size_t due = OrderStore(database).due(later, 9).size();
    hidden += due < kRows ? 1 : 0;
    EXPECT_GE(due, std::max<std::size_t>(least_of(offset), 1)) << offset;
  });
  EXPECT_GT(hidden, 0U) << "the flips damage a record";
}

}  // namespace
}  // namespace isomesh::store
