#include "server/store/outbox.h"

#include <chrono>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "server/store/file_blob_store.h"
#include "server/store/sqlite_job_store.h"
#include "server/store/sqlite_volume_store.h"
#include "tests/support/files.h"

namespace isomesh::store {
namespace {

using testing::ElementsAre;

std::vector<std::string> jobs_of(const std::vector<Delivery>& deliveries) {
  std::vector<std::string> jobs;
  for (const Delivery& delivery : deliveries) jobs.push_back(delivery.job);
  return jobs;
}

class OutboxTest : public testing::Test {
 protected:
  void add(const std::string& id, const std::string& url) {
    Job job;
    job.id = id;
    job.parameters.callback = Callback{url};
    Transaction transaction(database_.writer());
    Outbox::add(transaction.connection(), job);
    transaction.commit();
  }

  static Outbox::Time now() { return std::chrono::system_clock::now(); }

  test::TemporaryFolder folder_;
  DataFolder data_{folder_ / "data"};
  Database database_{data_};
  Outbox outbox_{database_};
};

TEST_F(OutboxTest, HoldsTheEndOfEveryJobThatHasACallback) {
  const FileBlobStore blobs(data_);
  SqliteVolumeStore volumes(database_);
  SqliteJobStore jobs(database_, blobs, JobStoreOptions{});
  Volume volume;
  volume.id = "aa";
  volumes.add("ct", volume);
  JobParameters parameters;
  parameters.volume = "aa";
  const std::string silent = job_of(jobs.submit({"ct", parameters, "", ""})).id;
  parameters.iso = 1;
  parameters.callback = Callback{"https://a.example.org/x"};
  const std::string cancelled = job_of(jobs.submit({"ct", parameters, "", ""})).id;
  EXPECT_EQ(outbox_.count(), 0U);
  jobs.cancel("ct", cancelled);
  jobs.cancel("ct", silent);
  const auto due = outbox_.due(now(), 9);
  ASSERT_EQ(due.size(), 1U);
  EXPECT_EQ(due[0].job, cancelled);
  EXPECT_EQ(due[0].url, "https://a.example.org/x");
  EXPECT_EQ(job_from_json(due[0].body), jobs.get("ct", cancelled));
  EXPECT_EQ(due[0].attempts, 0);
}

TEST_F(OutboxTest, OfEachReceiverSomeAreDue) {
  for (const std::string id : {"1", "2", "3"}) add(id, "https://a.example.org/" + id);
  add("4", "https://a.example.org:8443/");
  add("5", "https://b.example.org");
  EXPECT_THAT(jobs_of(outbox_.due(now(), 2)), ElementsAre("1", "2", "4", "5"));
  EXPECT_EQ(outbox_.count(), 5U);
  outbox_.remove("1");
  EXPECT_THAT(jobs_of(outbox_.due(now(), 2)), ElementsAre("2", "3", "4", "5"));
}

TEST_F(OutboxTest, WhatIsPostponedIsDueLater) {
  add("1", "https://a.example.org/");
  EXPECT_EQ(outbox_.next_after(now()), std::nullopt);
  const auto later = now() + std::chrono::hours(1);
  outbox_.postpone("1", later);
  EXPECT_TRUE(outbox_.due(now(), 9).empty());
  EXPECT_LT(std::chrono::abs(*outbox_.next_after(now()) - later), std::chrono::milliseconds(1));
  const auto due = outbox_.due(later + std::chrono::seconds(1), 9);
  ASSERT_EQ(due.size(), 1U);
  EXPECT_EQ(due[0].attempts, 1);
}

// Whom to tell changes no byte of the mesh.
TEST(ResultKey, DoesNotKnowTheCallback) {
  JobParameters parameters;
  const std::string key = result_key(parameters, "1");
  parameters.callback = Callback{"https://a.example.org/"};
  EXPECT_EQ(result_key(parameters, "1"), key);
}

}  // namespace
}  // namespace isomesh::store
