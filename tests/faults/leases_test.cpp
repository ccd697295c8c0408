// Tests of jobs whose daemon dies, is suspended or shuts down while they run.
#include <set>
#include <string>
#include <thread>

#include <sqlite3.h>

#include "tests/api/problems.h"
#include "tests/faults/fixture.h"

namespace isomesh {
namespace {

using namespace test;
using std::chrono::seconds;
using testing::HasSubstr;

class Leases : public FaultTest {};

TEST_F(Leases, StoppedBeyondTheLeaseItsLateResultIsRefused) {
  start({"--lease-seconds", "4", "--workers", "1"});
  const Job before = long_job(daemon());
  daemon().send_signal(SIGSTOP);
  std::this_thread::sleep_for(std::chrono::milliseconds(4500));
  daemon().send_signal(SIGCONT);
  ASSERT_TRUE(eventually([&] {
    const Job now = job(before.id);
    return now.state == JobState::kRunning && now.started != before.started;
  }));
  EXPECT_THAT(daemon().errors(), HasSubstr("lost its lease"));
  EXPECT_EQ(run_sql("SELECT attempts FROM jobs WHERE id = '" + before.id + "'"), "1");
  daemon().client().cancel(before.id);
  EXPECT_EQ(ended(before.id).state, JobState::kCancelled);
  EXPECT_EQ(blob_count(), 1U);
}

TEST_F(Leases, AJobWhoseProcessIsKilledThreeTimesFailsAndItsNeighbourGoesOn) {
  start({"--workers", "2"});
  const Job neighbour = long_job(daemon());
  const std::set<pid_t> others = job_processes();
  ASSERT_EQ(others.size(), 1U);
  const Job deadly = long_job(daemon(), 49);
  for (int death = 1; death <= 3; ++death) {
    ASSERT_TRUE(eventually([&] { return job(deadly.id).stage == Stage::kSmooth; })) << death;
    for (const pid_t process : job_processes()) {
      if (!others.contains(process)) ::kill(process, SIGKILL);
    }
    ASSERT_TRUE(eventually([&] {
      const Job now = job(deadly.id);
      return now.stage != Stage::kSmooth || now.state == JobState::kFailed;
    })) << death;
  }
  const Job failed = ended(deadly.id);
  EXPECT_EQ(failed.state, JobState::kFailed);
  EXPECT_EQ(failed.stage, Stage::kSmooth);
  ASSERT_TRUE(failed.error);
  EXPECT_EQ(failed.error->detail,
            "The job process ended with signal 9 (killed) in the stage \"smooth\".");
  const Job now = job(neighbour.id);
  EXPECT_EQ(now.state, JobState::kRunning);
  EXPECT_EQ(now.started, job(neighbour.id).started);
  EXPECT_TRUE(job_processes().contains(*others.begin()));
  EXPECT_EQ(run_sql("SELECT attempts FROM jobs WHERE id = '" + neighbour.id + "'"), "1");
  daemon().client().cancel(neighbour.id);
  EXPECT_EQ(ended(submit(daemon(), small_volume(), 100).id).state, JobState::kSucceeded);
}

// The disk gives way under a job, and nobody else notices.
TEST_F(Leases, AVolumeThatIsCutUnderARunningJobEndsThatJobAlone) {
  start({"--workers", "1"});
  const Volume volume = upload(daemon(), long_upload());
  const std::filesystem::path file = file_of(volume.samples);
  const std::string bytes = read_file(file);
  Job job;
  // One that has been read whole by then is none the worse for it.
  for (int tries = 0; tries < 40 && job.state != JobState::kFailed; ++tries) {
    write_file(file, bytes);
    job = submit(daemon(), volume, 40 + 0.5 * tries, R"("passes": 0)");
    std::this_thread::sleep_for(std::chrono::milliseconds(tries));
    std::filesystem::resize_file(file, 4096);
    job = ended(job.id);
    ASSERT_TRUE(job.state == JobState::kSucceeded || job.state == JobState::kFailed);
  }
  ASSERT_EQ(job.state, JobState::kFailed);
  EXPECT_EQ(job.error->status, 422);
  EXPECT_THAT(job.error->detail, HasSubstr("damaged"));
  for (const std::string view : {"/slice.png", "/histogram"}) {
    EXPECT_TRUE(
        is_problem(daemon().get("/v1/volumes/" + volume.id + view), ErrorCode::kUnusableVolume));
  }
  EXPECT_EQ(ended(submit(daemon(), small_volume(), 100).id).state, JobState::kSucceeded);
}

// Holds the database, so that the daemon can store a result but not name it.
class Blockade {
 public:
  explicit Blockade(const std::filesystem::path& database) {
    sqlite3_open(database.c_str(), &handle_);
    sqlite3_busy_timeout(handle_, 10'000);
    holds_ = sqlite3_exec(handle_, "BEGIN IMMEDIATE", nullptr, nullptr, nullptr) == SQLITE_OK;
  }
  ~Blockade() { sqlite3_close(handle_); }
  Blockade(const Blockade&) = delete;
  Blockade& operator=(const Blockade&) = delete;

  bool holds() const { return holds_; }

 private:
  sqlite3* handle_ = nullptr;
  bool holds_ = false;
};

TEST_F(Leases, KilledBetweenResultAndFinishItRunsAgainToTheSameBytes) {
  start({"--lease-seconds", "600", "--workers", "1"});  // no renewal has to pass the blockade
  const Volume volume = small_volume();
  ended(submit(daemon(), volume, 90).id);  // the worker has its process now
  const std::set<pid_t> processes = job_processes();
  ASSERT_EQ(processes.size(), 1U);
  const std::size_t blobs = blob_count();
  // The process stands still, so the job has begun and has no result when the blockade begins.
  ::kill(*processes.begin(), SIGSTOP);
  const std::string id = submit(daemon(), volume, 100).id;
  ASSERT_TRUE(comes_to(id, JobState::kRunning));
  const Job before = job(id);
  {
    const Blockade blockade(daemon().data() / "isomesh.sqlite");
    ASSERT_TRUE(blockade.holds());
    ::kill(*processes.begin(), SIGCONT);
    ASSERT_TRUE(eventually([&] { return blob_count() == blobs + 1; }));
    kill();
  }
  const std::vector<std::string> stored = blobs_below(folder_ / "data");
  start();
  const Job after = ended(id);
  EXPECT_NE(after.started, before.started);
  EXPECT_EQ(after.state, JobState::kSucceeded);
  EXPECT_EQ(blobs_below(folder_ / "data"), stored);
}

}  // namespace
}  // namespace isomesh
