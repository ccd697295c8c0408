// A daemon on a disk that is full, or too small.
#include <string>
#include <vector>

#include "tests/api/problems.h"
#include "tests/faults/fixture.h"
#include "tests/faults/small_disk.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;

constexpr std::uint64_t kMebibyte = 1 << 20;

class Disk : public testing::Test {
 protected:
  void SetUp() override {
    if (disk_.is_mounted()) return;
    GTEST_SKIP() << "NOT TESTED: this needs a file system of its own, and the system does not let "
                    "this user make namespaces";
  }

  void start(const std::vector<std::string>& arguments = {}) {
    daemon_.reset();
    daemon_.emplace(disk_.inside() / "data", "127.0.0.1:0", arguments, disk_.prefix());
  }
  void kill() { daemon_.reset(); }
  Daemon& daemon() { return *daemon_; }

  bool becomes_ready() {
    return eventually([&] { return daemon().get("/readyz").status == 200; });
  }
  std::uint64_t log_bytes() const {
    return std::filesystem::file_size(disk_.outside() / "data/isomesh.sqlite-wal");
  }

  // A volume of some megabytes that is like no other.
  Answer upload_much(char letter) {
    return daemon().send("POST", "/v1/volumes?dims=128,128,256&type=uint8",
                         std::string(128 * 128 * 256, letter));
  }

  const SmallDisk disk_{48 * kMebibyte};

 private:
  std::optional<Daemon> daemon_;
};

TEST_F(Disk, AFullOneCanBeFreed) {
  start();
  const Answer large = upload_much('a');
  ASSERT_EQ(large.status, 201) << large.body;
  const Job job = finished_job(daemon());
  const Job queued = long_job(daemon());
  disk_.fill("foreign");
  EXPECT_TRUE(is_problem(daemon().get("/readyz"), ErrorCode::kUnavailable));
  EXPECT_EQ(daemon().get("/livez").status, 200);
  EXPECT_TRUE(is_problem(upload_much('b'), ErrorCode::kOutOfSpace));
  const Answer cancelled = daemon().send("DELETE", "/v1/jobs/" + queued.id);
  EXPECT_EQ(cancelled.status, 200) << cancelled.body;
  ASSERT_TRUE(
      eventually([&] { return daemon().client().job(queued.id).state == JobState::kCancelled; }));
  // Somebody takes what was let go, too.
  disk_.fill("more");
  kill();
  disk_.fill("most");
  std::filesystem::remove(disk_.outside() / "more");
  start();
  EXPECT_EQ(daemon().client().job(job.id), job);
  EXPECT_TRUE(is_problem(daemon().get("/readyz"), ErrorCode::kUnavailable));
  const std::string id = volume_from_json(large.body).id;
  const Answer erased = daemon().send("DELETE", "/v1/volumes/" + id);
  EXPECT_EQ(erased.status, 204) << erased.body;
  EXPECT_TRUE(becomes_ready());
  EXPECT_EQ(finished_job(daemon(), "\"passes\": 1").state, JobState::kSucceeded);
}

// Right after a crash, with not a byte left but the reserve.
TEST_F(Disk, AFullOneCanBeStartedOn) {
  start();
  const Job job = finished_job(daemon());
  kill();
  disk_.fill("foreign");
  start();
  EXPECT_EQ(daemon().client().job(job.id), job);
  EXPECT_EQ(daemon().send("DELETE", "/v1/volumes/" + job.parameters.volume).status, 204);
  std::filesystem::remove(disk_.outside() / "foreign");
  EXPECT_TRUE(becomes_ready());
}

TEST_F(Disk, WhatIsTooOldStillExpires) {
  start();
  const Job job = finished_job(daemon());
  EXPECT_EQ(daemon().stop(), 0);
  disk_.fill("foreign");
  start({"--keep-days", "0.00002"});
  EXPECT_TRUE(eventually([&] { return daemon().get("/v1/jobs/" + job.id).status == 410; }));
}

// Its triangles are known before a byte of it is written.
TEST_F(Disk, AJobThatCanNeverFitFailsAndSaysSo) {
  start();
  const Volume volume = upload(daemon(), long_upload());
  const std::string members = R"("formats": ["stl"], "passes": 0)";
  const Job failed = daemon().client().wait(submit(daemon(), volume, 50, members).id);
  EXPECT_EQ(failed.state, JobState::kFailed);
  ASSERT_TRUE(failed.error);
  EXPECT_EQ(failed.error->status, 413);
  EXPECT_THAT(failed.error->detail, HasSubstr("but the disk can hold at most"));
  EXPECT_TRUE(eventually([&] { return daemon().get("/readyz").status == 200; }));
}

TEST_F(Disk, AJobThatMayFitLaterWaitsAndSaysSo) {
  start();
  ASSERT_TRUE(becomes_ready());
  const RawUpload raw = raw_upload(noise<std::uint8_t>({0, 100}, {48, 48, 48}, 11));
  const Volume volume = upload(daemon(), raw);
  disk_.fill("foreign", 8 * kMebibyte);
  const std::string members = R"("formats": ["stl"], "passes": 0)";
  const std::string id = submit(daemon(), volume, 50, members).id;
  Job seen;
  ASSERT_TRUE(eventually([&] {
    seen = daemon().client().job(id);
    return seen.waiting_for || is_final(seen.state);
  })) << daemon().errors();
  EXPECT_EQ(seen.state, JobState::kQueued);
  EXPECT_EQ(seen.waiting_for, WaitingFor::kDisk);
  const auto is_told = [&] {
    const std::string metrics = daemon().get("/metrics").body;
    return metrics.find("isomesh_jobs_waiting_for_disk 1\n") != std::string::npos;
  };
  EXPECT_TRUE(eventually(is_told)) << "while it is not tried again";
  // Others still fit.
  EXPECT_TRUE(eventually([&] { return daemon().get("/readyz").status == 200; }));
  EXPECT_TRUE(
      eventually([&] { return daemon().client().job(id).waiting_for == WaitingFor::kDisk; }));
  EXPECT_EQ(finished_job(daemon(), "\"passes\": 1").state, JobState::kSucceeded);
  std::filesystem::remove(disk_.outside() / "foreign");
  const Job done = daemon().client().wait(id);
  EXPECT_EQ(done.state, JobState::kSucceeded);
  EXPECT_EQ(done.waiting_for, std::nullopt);
  EXPECT_TRUE(becomes_ready());
}

// 1 000 jobs and their events are some megabytes of changes.
TEST_F(Disk, TheLogOfChangesStaysSmall) {
  start({"--max-queue", "2000", "--workers", "1"});
  const Job running = long_job(daemon());
  const Volume volume = upload(daemon(), sphere_upload());
  std::uint64_t longest = 0;
  for (int n = 0; n < 500; ++n) {
    submit(daemon(), volume, 10 + 0.1 * n);
    longest = std::max(longest, log_bytes());
  }
  EXPECT_LE(longest, 3 * kMebibyte);
  daemon().client().cancel(running.id);
}

}  // namespace
}  // namespace isomesh
