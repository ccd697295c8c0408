// Data folders of other versions, and what expires.
#include <string>

#include "base/sha256.h"
#include "tests/api/problems.h"
#include "tests/faults/fixture.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;

class Folder : public FaultTest {};

TEST_F(Folder, OfANewerVersionIsRefusedAndLeftAsItIs) {
  start();
  small_volume();
  EXPECT_EQ(daemon().stop(), 0);
  run_sql("UPDATE schema_versions SET version = version + 900");
  const Finished refused = refused_start(folder_ / "data");
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.errors, HasSubstr("newer isomeshd"));
  EXPECT_THAT(refused.errors, testing::ContainsRegex("records have version 9[0-9][0-9],"));
  run_sql("UPDATE schema_versions SET version = version - 900");
  start();
  EXPECT_EQ(daemon().client().volumes().size(), 1U);
}

TEST_F(Folder, WhatHasExpiredIsGone) {
  start({"--keep-days", "0.0003"});  // 26 s
  const Job job = finished_job(daemon());
  const std::string path = "/v1/jobs/" + job.id;
  ASSERT_TRUE(eventually([&] { return daemon().get(path).status == 410; }));
  EXPECT_TRUE(is_problem(daemon().get(path), ErrorCode::kGone));
  EXPECT_TRUE(is_problem(daemon().get(path + "/mesh.drc"), ErrorCode::kGone));
  const std::string volume = "/v1/volumes/" + job.parameters.volume;
  ASSERT_TRUE(eventually([&] { return daemon().get(volume).status == 410; }));
  EXPECT_TRUE(daemon().client().volumes().empty());
  EXPECT_EQ(finished_job(daemon()).state, JobState::kSucceeded) << "it can be sent again";
}

TEST_F(Folder, AnUploadBeyondTheRoomForAllIsRefused) {
  start({"--max-disk", "5000"});
  const RawUpload raw = sphere_upload();
  EXPECT_TRUE(is_problem(daemon().send("POST", "/v1/volumes?" + raw.query, raw.bytes),
                         ErrorCode::kOutOfSpace));
  EXPECT_EQ(blob_count(), 0U);
}

// The files of volumes and meshes that are there, and those that wait to be removed.
std::uint64_t stored_bytes(const std::filesystem::path& data) {
  std::uint64_t bytes = 0;
  for (const auto* folder : {"blobs", "quarantine"}) {
    for (const std::string& name : files_below(data / folder)) {
      std::error_code gone;
      const std::uintmax_t size = std::filesystem::file_size(data / folder / name, gone);
      if (!gone && name != "identity") bytes += size;
    }
  }
  return bytes;
}

// While jobs write, not when somebody looks later.
TEST_F(Folder, TheRoomForAllIsKeptByWhatJobsWrite) {
  constexpr std::uint64_t kMost = 500'000;
  start({"--max-disk", std::to_string(kMost), "--workers", "1"});
  const Volume volume = small_volume();
  std::uint64_t written = 0;
  for (int n = 0; n < 20; ++n) {
    const Job job = ended(submit(daemon(), volume, 60 + n, R"("formats": ["stl"])").id);
    ASSERT_EQ(job.state, JobState::kSucceeded);
    written += job.mesh->files.at(MeshFormat::kStl).bytes;
    EXPECT_LE(stored_bytes(folder_ / "data"), kMost);
    EXPECT_EQ(daemon().get("/v1/jobs/" + job.id + "/mesh.stl").status, 200);
  }
  EXPECT_GT(written, 2 * kMost) << "more than fits was written";
  // One that is larger than all the room is no matter of time.
  const Job large =
      ended(submit(daemon(),
                   upload(daemon(), raw_upload(noise<std::uint8_t>({0, 100}, {32, 32, 32}, 11))),
                   50, R"("formats": ["stl"])")
                .id);
  EXPECT_EQ(large.state, JobState::kFailed);
  EXPECT_EQ(large.error->status, 413);
}

// The sweeper would take all files for litter.
TEST_F(Folder, WithoutItsDatabaseIsRefusedUnlessAdopted) {
  start();
  const Job job = finished_job(daemon());
  EXPECT_EQ(daemon().stop(), 0);
  const std::size_t blobs = blob_count();
  std::filesystem::create_directory(folder_ / "away");
  std::filesystem::rename(folder_ / "data/isomesh.sqlite", folder_ / "away/isomesh.sqlite");
  const Finished refused = refused_start(folder_ / "data");
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.errors, HasSubstr("--adopt"));
  EXPECT_EQ(blob_count(), blobs);
  start({"--adopt"});
  EXPECT_TRUE(daemon().client().volumes().empty());
  ASSERT_TRUE(eventually([&] { return blob_count() == 0; }));
  EXPECT_EQ(files_below(folder_ / "data/quarantine").size(), blobs);
  EXPECT_EQ(daemon().stop(), 0);
  // The right one is found after all, and the files with it.
  std::filesystem::remove(folder_ / "data/isomesh.sqlite");
  std::filesystem::rename(folder_ / "away/isomesh.sqlite", folder_ / "data/isomesh.sqlite");
  EXPECT_EQ(refused_start(folder_ / "data").status, 1);
  start({"--adopt"});
  EXPECT_EQ(daemon().get(job.mesh->files.at(MeshFormat::kDrc).href).status, 200);
}

// As a start with a clock that is 40 days ahead would find it.
TEST_F(Folder, NothingExpiresByAClockThatIsFarAhead) {
  start();
  const Job job = finished_job(daemon());
  EXPECT_EQ(daemon().stop(), 0);
  const std::string days_ago = " - 40 * 86400000000";
  // It was 20 days old then: not yet too old, and not just used.
  run_sql("UPDATE jobs SET finished = finished - 60 * 86400000000, accepted = accepted" + days_ago);
  run_sql("UPDATE volumes SET used = used" + days_ago);
  run_sql("CREATE TABLE IF NOT EXISTS identity(seen INTEGER)");
  run_sql("UPDATE identity SET seen = seen" + days_ago);
  std::string stray = blobs_below(folder_ / "data").front();
  stray.back() = stray.back() == '0' ? '1' : '0';
  write_file(folder_ / "data/blobs" / stray, "named by no record");
  start();
  EXPECT_THAT(daemon().errors(), HasSubstr("the clock is far ahead"));
  // The last that a round of housekeeping does, after what expires.
  ASSERT_TRUE(eventually(
      [&] { return daemon().errors().find("put into quarantine") != std::string::npos; }));
  EXPECT_EQ(daemon().get("/v1/jobs/" + job.id).status, 200);
  EXPECT_EQ(daemon().get("/v1/volumes/" + job.parameters.volume).status, 200);
  EXPECT_EQ(daemon().stop(), 0);
  start({"--trust-clock"});
  EXPECT_TRUE(eventually([&] { return daemon().get("/v1/jobs/" + job.id).status == 410; }));
  const std::string expired = job.id + " unused since ";
  EXPECT_TRUE(eventually([&] { return daemon().errors().find(expired) != std::string::npos; }));
  EXPECT_THAT(daemon().errors(), HasSubstr("limit=--keep-days"));
  EXPECT_EQ(daemon().get("/v1/volumes/" + job.parameters.volume).status, 200) << "just used";
}

// Entries as they are kept: each has the digest of the one before it, a line break and its line.
TEST_F(Folder, AnAuditTrailIsVerified) {
  start();
  EXPECT_EQ(daemon().stop(), 0);
  std::string digest;
  for (const std::string id : {"1", "2"}) {
    const std::string at = "2026-01-02T03:04:05.678Z";
    digest = sha256_of(digest + "\n{\"id\":" + id + ",\"at\":\"" + at + "\",\"event\":\"110120\"}");
    run_sql("INSERT INTO audit(id, at, record, chain) VALUES(" + id + ", '" + at +
            "', '{\"event\":\"110120\"}', '" + digest + "')");
  }
  const std::vector<std::string> command = {ISOMESHD, "audit", "--verify", "--data",
                                            folder_ / "data"};
  const Finished intact = run(command);
  EXPECT_EQ(intact.status, 0) << intact.errors;
  EXPECT_EQ(intact.output, "2 entries fit; the digest of 2 is " + digest + "\n");
  run_sql("DROP TRIGGER audit_is_not_changed");
  run_sql("UPDATE audit SET record = '{\"event\":\"110121\"}' WHERE id = 2");
  const Finished tampered = run(command);
  EXPECT_EQ(tampered.status, 1);
  EXPECT_THAT(tampered.errors, HasSubstr("entry 2 of the audit trail does not fit"));
}

}  // namespace
}  // namespace isomesh
