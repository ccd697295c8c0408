#include "server/store/retention.h"

#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "proto/json.h"
#include "server/store/sqlite_job_store.h"
#include "server/store/sqlite_volume_store.h"
#include "tests/support/errors.h"
#include "tests/support/files.h"

namespace isomesh::store {
namespace {

using std::chrono::milliseconds;
using test::code_thrown_by;

class RetentionTest : public testing::Test {
 protected:
  Blob put(const std::string& text) {
    const auto writer = blobs_.begin();
    writer->write(test::as_span(text));
    return writer->commit();
  }

  // A volume of so many bytes.
  std::string add_volume(char letter, std::size_t bytes, const std::string& owner = "") {
    Volume volume;
    volume.id = put(std::string(bytes, letter)).key;
    volume.bytes = bytes;
    volume.created = timestamp();
    volumes_.add(owner, volume);
    return volume.id;
  }

  std::string submit(const std::string& volume, double iso) {
    JobSpec spec;
    spec.parameters.volume = volume;
    spec.parameters.iso = iso;
    return job_of(jobs_.submit(spec)).id;
  }

  // A finished job whose mesh has those bytes.
  std::string finish(const std::string& volume, const std::string& mesh) {
    const std::string id = submit(volume, ++last_iso_);
    const Lease lease = jobs_.claim("worker", milliseconds(60'000)).value();
    const Blob blob = put(mesh);
    Outcome outcome;
    outcome.mesh.emplace().files[MeshFormat::kDrc] = {blob.bytes, blob.key, ""};
    EXPECT_TRUE(jobs_.finish(lease, outcome));
    return id;
  }

  Retention retention(std::uint64_t max_bytes, milliseconds keep = std::chrono::hours(1)) {
    return {data_,
            database_,
            blobs_,
            {.keep = keep, .max_bytes = max_bytes, .grace = milliseconds(-2000)}};
  }

  bool is_gone(const std::string& id) {
    const auto job = code_thrown_by([&] { jobs_.get("", id); });
    const auto volume = code_thrown_by([&] { volumes_.get("", id); });
    return job == ErrorCode::kGone && volume == ErrorCode::kGone;
  }
  bool is_job(const std::string& id) {
    return !code_thrown_by([&] { jobs_.get("", id); }).has_value();
  }

  std::size_t files() { return test::files_below(data_.blobs()).size(); }

  test::TemporaryFolder folder_;
  DataFolder data_{folder_ / "data"};
  Database database_{data_};
  FileBlobStore blobs_{data_};
  SqliteVolumeStore volumes_{database_};
  SqliteJobStore jobs_{database_, blobs_, {}};
  double last_iso_ = 0;
};

TEST_F(RetentionTest, KeepsWhatIsYoungAndFits) {
  const std::string volume = add_volume('v', 100);
  const std::string job = finish(volume, "mesh");
  Retention retention = this->retention(200);
  EXPECT_EQ(retention.named_bytes(), 104U);
  const auto gone = retention.enforce();
  EXPECT_EQ(gone.jobs + gone.volumes + gone.blobs, 0U);
  EXPECT_TRUE(is_job(job));
  EXPECT_EQ(files(), 2U);
}

TEST_F(RetentionTest, WhatIsTooOldExpiresWithItsFiles) {
  const std::string volume = add_volume('v', 100);
  const std::string job = finish(volume, "mesh");
  const auto gone = retention(0, milliseconds(-1000)).enforce();
  EXPECT_EQ(gone.jobs, 1U);
  EXPECT_EQ(gone.volumes, 1U);
  EXPECT_EQ(gone.blobs, 2U);
  EXPECT_TRUE(is_gone(job));
  EXPECT_TRUE(is_gone(volume));
  EXPECT_EQ(files(), 0U);
  EXPECT_TRUE(jobs_.events("", job, 0, milliseconds(0)).empty());
}

TEST_F(RetentionTest, WhatLiveJobsNeedStays) {
  const std::string of_queued = add_volume('q', 100);
  const std::string of_running = add_volume('r', 100);
  const std::string running = submit(of_running, 1);
  const Lease lease = jobs_.claim("worker", milliseconds(60'000)).value();
  const std::string queued = submit(of_queued, 1);
  retention(1, milliseconds(-1000)).enforce();
  EXPECT_TRUE(is_job(running));
  EXPECT_TRUE(is_job(queued));
  EXPECT_TRUE(volumes_.contains("", of_queued));
  EXPECT_TRUE(volumes_.contains("", of_running));
  EXPECT_EQ(files(), 2U);
  EXPECT_TRUE(jobs_.finish(lease, {}));
}

// The mesh is stored, its worker is about to name it.
TEST_F(RetentionTest, WhatARunningJobHasStoredStays) {
  const std::string volume = add_volume('v', 100);
  submit(volume, 1);
  const Lease lease = jobs_.claim("worker", milliseconds(60'000)).value();
  put("mesh");
  Retention patient(data_, database_, blobs_, {.grace = milliseconds(100)});
  EXPECT_EQ(patient.enforce().blobs, 0U);
  EXPECT_EQ(files(), 2U);
  jobs_.finish(lease, {});
  EXPECT_EQ(retention(0).enforce().blobs, 1U);
}

TEST_F(RetentionTest, BeyondItsBytesTheOldestGoesFirst) {
  const std::string volume = add_volume('v', 100);
  const std::string first = finish(volume, std::string(50, '1'));
  const std::string second = finish(volume, std::string(50, '2'));
  const std::string third = finish(volume, std::string(50, '3'));
  const auto gone = retention(220).enforce();
  EXPECT_EQ(gone.jobs, 1U);
  EXPECT_TRUE(is_gone(first));
  EXPECT_TRUE(is_job(second));
  EXPECT_TRUE(is_job(third));
  EXPECT_TRUE(volumes_.contains("", volume)) << "it was used after the first job's end";
  EXPECT_EQ(files(), 3U);
}

TEST_F(RetentionTest, AMeshOfTwoJobsTakesRoomOnce) {
  const std::string volume = add_volume('v', 100);
  const std::string first = finish(volume, std::string(50, 'm'));
  const std::string second = finish(volume, std::string(50, 'm'));
  EXPECT_EQ(retention(150).enforce().jobs, 0U);
  EXPECT_EQ(retention(149).enforce().jobs, 2U);
  EXPECT_TRUE(is_gone(first));
  EXPECT_TRUE(is_gone(second));
}

TEST_F(RetentionTest, MakesRoomForAnUploadOrSaysThatThereIsNone) {
  const std::string volume = add_volume('v', 100);
  const std::string job = finish(volume, std::string(50, 'm'));
  Retention retention = this->retention(200);
  retention.make_room(50);
  EXPECT_TRUE(is_job(job));
  retention.make_room(100);
  EXPECT_TRUE(is_gone(job));
  EXPECT_TRUE(volumes_.contains("", volume));
  submit(volume, 1000);
  EXPECT_EQ(code_thrown_by([&] { retention.make_room(101); }), ErrorCode::kOutOfSpace);
  EXPECT_EQ(code_thrown_by([&] { retention.make_room(1000); }), ErrorCode::kOutOfSpace);
  EXPECT_TRUE(volumes_.contains("", volume));
}

TEST_F(RetentionTest, OneOwnersVolumeExpiresAloneAndItsSamplesStay) {
  const std::string id = add_volume('v', 100, "other");
  add_volume('v', 100);
  JobSpec spec;
  spec.owner = "other";
  spec.parameters.volume = id;
  spec.parameters.iso = 1;
  jobs_.submit(spec);
  retention(0, milliseconds(-1000)).enforce();
  EXPECT_EQ(code_thrown_by([&] { volumes_.get("", id); }), ErrorCode::kGone);
  EXPECT_TRUE(volumes_.contains("other", id));
  EXPECT_EQ(files(), 1U);
}

TEST_F(RetentionTest, WhatHasExpiredCanComeBack) {
  const std::string volume = add_volume('v', 100);
  retention(0, milliseconds(-1000)).enforce();
  JobSpec spec;
  spec.parameters.volume = volume;
  spec.parameters.iso = 1;
  EXPECT_EQ(code_thrown_by([&] { jobs_.submit(spec); }), ErrorCode::kGone);
  EXPECT_EQ(add_volume('v', 100), volume);
  EXPECT_EQ(jobs_.submit(spec).kind, Submission::Kind::kNew);
}

TEST_F(RetentionTest, ExpiredIdsAreForgottenInTheEnd) {
  const std::string volume = add_volume('v', 100);
  Retention forgetful(data_, database_, blobs_,
                      {.keep = milliseconds(-1000), .remember = milliseconds(-1000)});
  forgetful.enforce();
  EXPECT_EQ(code_thrown_by([&] { volumes_.get("", volume); }), ErrorCode::kNotFound);
}

TEST_F(RetentionTest, OldUnfinishedFilesAreSwept) {
  const auto young = data_.scratch() / "young";
  const auto old = data_.scratch() / "old";
  test::write_file(young, "1");
  test::write_file(old, "2");
  std::filesystem::last_write_time(
      old, std::filesystem::file_time_type::clock::now() - std::chrono::hours(25));
  retention(0).enforce();
  EXPECT_TRUE(std::filesystem::exists(young));
  EXPECT_FALSE(std::filesystem::exists(old));
}

}  // namespace
}  // namespace isomesh::store
