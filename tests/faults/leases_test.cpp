// What becomes of jobs whose daemon dies, sleeps or is stopped while they run.
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

// How long a job has to run for its daemon's death to be charged to it.
constexpr std::chrono::milliseconds kLongRun{2000};

TEST_F(Leases, KilledRightAfterEachAcceptanceAllFinish) {
  start();
  const Volume volume = small_volume();
  std::vector<std::string> accepted;
  for (int round = 0; round < 6; ++round) {
    accepted.push_back(submit(daemon(), volume, 60 + round).id);
    kill();
    start();
  }
  for (const std::string& id : accepted) EXPECT_EQ(ended(id).state, JobState::kSucceeded);
}

TEST_F(Leases, KilledInTheMiddleOfAJobItRunsAgainAndGivesOneResult) {
  start();
  const Job before = running_job(12);
  kill();
  start();
  EXPECT_TRUE(eventually(
      [&] {
        const Job now = job(before.id);
        return now.state == JobState::kRunning && now.started != before.started;
      },
      seconds(2)));
  const Job after = ended(before.id);
  EXPECT_EQ(after.state, JobState::kSucceeded);
  EXPECT_EQ(blob_count(), 2U);
  EXPECT_EQ(daemon().client().jobs().jobs.size(), 1U);
}

TEST_F(Leases, StoppedBeyondTheLeaseItsLateResultIsRefused) {
  start({"--lease-seconds", "1", "--workers", "1"});
  const Job before = running_job(1000);
  daemon().send_signal(SIGSTOP);
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));
  daemon().send_signal(SIGCONT);
  ASSERT_TRUE(eventually([&] {
    const Job now = job(before.id);
    return now.state == JobState::kRunning && now.started != before.started;
  }));
  EXPECT_THAT(daemon().errors(), HasSubstr("had lost its lease"));
  daemon().client().cancel(before.id);
  EXPECT_EQ(ended(before.id).state, JobState::kCancelled);
  EXPECT_EQ(blob_count(), 1U);
}

TEST_F(Leases, AJobThatEndsItsDaemonThreeTimesFailsAndOthersGoOn) {
  start({"--workers", "1"});
  const Job deadly = running_job(1000);
  const std::string other = submit(daemon(), small_volume(), 100).id;
  for (int death = 1; death <= 3; ++death) {
    ASSERT_TRUE(comes_to(deadly.id, JobState::kRunning)) << death;
    std::this_thread::sleep_for(kLongRun);
    kill();
    start({"--workers", "1"});
  }
  const Job failed = job(deadly.id);
  EXPECT_EQ(failed.state, JobState::kFailed);
  ASSERT_TRUE(failed.error);
  EXPECT_THAT(failed.error->detail, HasSubstr("3 times"));
  EXPECT_EQ(ended(other).state, JobState::kSucceeded);
}

// Whoever ends a daemon in an orderly way may do so as often as he likes.
TEST_F(Leases, AnOrderlyEndCountsNoAttempt) {
  start({"--drain-seconds", "0"});
  const Job endless = running_job(1000);
  for (int end = 1; end <= 4; ++end) {
    ASSERT_TRUE(comes_to(endless.id, JobState::kRunning)) << end;
    EXPECT_EQ(daemon().stop(), 0);
    start({"--drain-seconds", "0"});
  }
  EXPECT_TRUE(comes_to(endless.id, JobState::kRunning));
}

// A defect of ours: the folder of unfinished files is none.
TEST_F(Leases, AJobThatAlwaysFailsIsTriedThreeTimesWithGrowingPauses) {
  start();
  const Volume volume = small_volume();
  const auto scratch = daemon().data() / "scratch";
  std::filesystem::remove_all(scratch);
  write_file(scratch, "");
  const auto begin = std::chrono::steady_clock::now();
  const Job failed = ended(submit(daemon(), volume, 100).id);
  EXPECT_EQ(failed.state, JobState::kFailed);
  EXPECT_EQ(failed.error->status, 500);
  EXPECT_GE(std::chrono::steady_clock::now() - begin, seconds(1 + 4));
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
  start({"--lease-seconds", "600"});  // no renewal has to pass the blockade
  const Job before = running_job(12);
  {
    const Blockade blockade(daemon().data() / "isomesh.sqlite");
    ASSERT_TRUE(blockade.holds());
    ASSERT_TRUE(eventually([&] { return blob_count() == 2; }));
    kill();
  }
  const std::vector<std::string> stored = files_below(folder_ / "data/blobs");
  start();
  EXPECT_NE(job(before.id).state, JobState::kSucceeded);
  const Job after = ended(before.id);
  EXPECT_EQ(after.state, JobState::kSucceeded);
  EXPECT_EQ(files_below(folder_ / "data/blobs"), stored);
}

TEST_F(Leases, ACancelledJobStopsWithinTwoSecondsAndPublishesNothing) {
  start({"--workers", "1"});
  const Job running = running_job(1000);
  const std::string queued = submit(daemon(), small_volume(), 100).id;
  daemon().client().cancel(queued);
  daemon().client().cancel(running.id);
  EXPECT_TRUE(comes_to(running.id, JobState::kCancelled, seconds(2)));
  EXPECT_EQ(job(queued).state, JobState::kCancelled);
  EXPECT_FALSE(job(queued).started);
  EXPECT_EQ(blob_count(), 2U) << "the two volumes and nothing else";
  EXPECT_EQ(scratch_count(), 0U);
}

TEST_F(Leases, CancelRacingTheEndGivesOneEnd) {
  start();
  const Volume volume = small_volume();
  std::set<JobState> seen;
  for (int round = 0; round < 25; ++round) {
    const std::string id = submit(daemon(), volume, 40 + round).id;
    std::this_thread::sleep_for(std::chrono::milliseconds(2 * round));
    daemon().client().cancel(id);
    const Job end = ended(id);
    seen.insert(end.state);
    ASSERT_TRUE(end.state == JobState::kCancelled || end.state == JobState::kSucceeded);
    EXPECT_EQ(end.mesh.has_value(), end.state == JobState::kSucceeded);
    daemon().client().cancel(id);
    EXPECT_EQ(job(id), end);
  }
  EXPECT_TRUE(seen.contains(JobState::kCancelled));
}

}  // namespace
}  // namespace isomesh
