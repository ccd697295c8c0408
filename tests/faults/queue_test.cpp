// Tests of requests: many at once, repeated or cut short, with a full queue or a full disk.
#include <string>

#include <sys/resource.h>

#include "tests/api/problems.h"
#include "tests/faults/fixture.h"

namespace isomesh {
namespace {

using namespace test;

class Queue : public FaultTest {
 protected:
  Answer post(const std::string& body, const std::string& key = {}) {
    const Headers headers = key.empty() ? Headers{} : Headers{{"Idempotency-Key", key}};
    return daemon().send("POST", "/v1/jobs", body, headers);
  }
};

TEST_F(Queue, AnUploadThatIsCutByTheDaemonsEndLeavesNothing) {
  start();
  const RawUpload raw = long_upload();
  const std::string whole = request("POST", "/v1/volumes?" + raw.query, raw.bytes);
  {
    const Connection connection(daemon().url());
    connection.send(whole.substr(0, whole.size() / 2));
    ASSERT_TRUE(eventually([&] { return scratch_count() > 0; }));
    kill();
  }
  start();
  EXPECT_EQ(scratch_count(), 0U);
  EXPECT_EQ(blob_count(), 0U);
  EXPECT_TRUE(daemon().client().volumes().empty());
}

// A limit on the size of files fails as a full disk does, and can be lifted again.
TEST_F(Queue, AFullDiskIsToldAndAcceptedJobsStay) {
  start({"--workers", "1"});
  const Volume volume = small_volume();
  const Job running = long_job(daemon());
  const std::string queued = submit(daemon(), volume, 100).id;
  const auto limit = [&](rlim_t bytes) {
    const rlimit value = {bytes, RLIM_INFINITY};
    return ::prlimit(daemon().pid(), RLIMIT_FSIZE, &value, nullptr);
  };
  ASSERT_EQ(limit(1), 0);
  EXPECT_TRUE(is_problem(post(job_body(volume.id, 90), "kept"), ErrorCode::kOutOfSpace));
  EXPECT_TRUE(is_problem(
      daemon().send("POST", "/v1/volumes?" + sphere_upload().query, sphere_upload().bytes),
      ErrorCode::kOutOfSpace));
  EXPECT_EQ(daemon().get("/livez").status, 200);
  EXPECT_EQ(job(queued).state, JobState::kQueued);
  EXPECT_EQ(daemon().client().volumes().size(), 2U);
  ASSERT_EQ(limit(RLIM_INFINITY), 0);
  EXPECT_EQ(post(job_body(volume.id, 90), "kept").status, 202);
  daemon().client().cancel(running.id);
  EXPECT_EQ(ended(queued).state, JobState::kSucceeded);
  EXPECT_TRUE(eventually([&] { return scratch_count() == 0; }));
}

// The samples of both fit; what one would make does not.
TEST_F(Queue, AJobHasMemoryOfItsOwn) {
  start({"--workers", "2", "--threads", "2", "--job-memory", "64MiB"});
  const Job refused = ended(submit(daemon(), upload(daemon(), long_upload()), 50).id);
  EXPECT_EQ(refused.state, JobState::kFailed);
  EXPECT_EQ(refused.error->status, 413);
  EXPECT_THAT(refused.error->detail, testing::HasSubstr("64 MiB are allowed"));
  EXPECT_EQ(ended(submit(daemon(), small_volume(), 100).id).state, JobState::kSucceeded);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // there memory is not limited
  for (const pid_t process : job_processes()) {
    const std::string limits = read_file("/proc/" + std::to_string(process) + "/limits");
    const std::size_t line = limits.find("Max data size");
    ASSERT_NE(line, std::string::npos);
    EXPECT_LT(std::stoull(limits.substr(limits.find_first_of("0123456789", line))), 1ULL << 30);
  }
#endif
}

// The mesh does not fit; the job is run again when there is room.
TEST_F(Queue, AJobThatFindsTheDiskFullWaitsForRoom) {
  start({"--workers", "1"});
  const Volume volume = upload(daemon(), long_upload());
  const rlimit small = {20'000'000, RLIM_INFINITY};  // the database fits, the mesh does not
  ASSERT_EQ(::prlimit(daemon().pid(), RLIMIT_FSIZE, &small, nullptr), 0);
  const std::string id = submit(daemon(), volume, 50, R"("formats": ["stl"], "passes": 0)").id;
  ASSERT_TRUE(
      eventually([&] { return daemon().errors().find("no space left") != std::string::npos; }));
  ASSERT_TRUE(comes_to(id, JobState::kQueued));
  const rlimit none = {RLIM_INFINITY, RLIM_INFINITY};
  ASSERT_EQ(::prlimit(daemon().pid(), RLIMIT_FSIZE, &none, nullptr), 0);
  EXPECT_EQ(ended(id).state, JobState::kSucceeded);
}

}  // namespace
}  // namespace isomesh
