// What becomes of jobs whose daemon dies, sleeps or is stopped while they run.
#include <algorithm>
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
  const std::vector<std::string> options = {"--lease-seconds", "600"};  // nobody waits for its end
  start(options);
  EXPECT_TRUE(with_a_job_that_is_long_enough([&](int passes) {
    const std::size_t blobs = std::max<std::size_t>(blob_count(), 1);  // at least the volume's
    const std::size_t jobs = daemon().client().jobs().jobs.size();
    const Job before = begun_job(passes);
    kill();
    start(options);
    const Job after = ended(before.id);
    EXPECT_EQ(after.state, JobState::kSucceeded);
    EXPECT_EQ(blob_count(), blobs + 1);
    EXPECT_EQ(daemon().client().jobs().jobs.size(), jobs + 1);
    return after.started != before.started;
  }));
}

TEST_F(Leases, StoppedBeyondTheLeaseItsLateResultIsRefused) {
  start({"--lease-seconds", "1", "--workers", "1"});
  const Job before = endless_job();
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
  const Job deadly = endless_job();
  const std::string other = submit(daemon(), small_volume(), 100).id;
  for (int death = 1; death <= 3; ++death) {
    ASSERT_TRUE(comes_to(deadly.id, JobState::kRunning)) << death;
    // Its daemon's death is charged to a job when it has run for a while.
    ASSERT_TRUE(eventually(
        [&] { return run_sql("SELECT is_long FROM jobs WHERE id = '" + deadly.id + "'") == "1"; }));
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
  const Job endless = endless_job();
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
  EXPECT_TRUE(with_a_job_that_is_long_enough([&](int passes) {
    upload(daemon(), long_upload());
    const std::size_t blobs = blob_count();
    const Job before = begun_job(passes);
    {
      const Blockade blockade(daemon().data() / "isomesh.sqlite");
      EXPECT_TRUE(blockade.holds());
      if (job(before.id).state != JobState::kRunning) return false;
      EXPECT_TRUE(eventually([&] { return blob_count() == blobs + 1; }));
      kill();
    }
    const std::vector<std::string> stored = blobs_below(folder_ / "data");
    start();
    const Job after = ended(before.id);
    EXPECT_NE(after.started, before.started);
    EXPECT_EQ(after.state, JobState::kSucceeded);
    EXPECT_EQ(blobs_below(folder_ / "data"), stored);
    return true;
  }));
}

TEST_F(Leases, ACancelledJobStopsWithinTwoSecondsAndPublishesNothing) {
  start({"--workers", "1"});
  const Job running = endless_job();
  const std::string queued = submit(daemon(), small_volume(), 100).id;
  daemon().client().cancel(queued);
  // The machine may have other things to do: one prompt end of some shows that it is possible.
  bool is_prompt = false;
  for (int n = 0; n < 5 && !is_prompt; ++n) {
    const std::string id = n == 0 ? running.id : endless_job().id;
    daemon().client().cancel(id);
    is_prompt = comes_to(id, JobState::kCancelled, seconds(2));
    ASSERT_TRUE(comes_to(id, JobState::kCancelled));
  }
  EXPECT_TRUE(is_prompt);
  EXPECT_EQ(job(queued).state, JobState::kCancelled);
  EXPECT_FALSE(job(queued).started);
  EXPECT_EQ(blob_count(), 2U) << "the two volumes and nothing else";
  EXPECT_EQ(scratch_count(), 0U);
}

TEST_F(Leases, CancelRacingTheEndGivesOneEnd) {
  start();
  const Volume volume = small_volume();
  for (int round = 0; round < 25; ++round) {
    const std::string id = submit(daemon(), volume, 40 + round).id;
    std::this_thread::sleep_for(std::chrono::milliseconds(2 * round));
    daemon().client().cancel(id);
    const Job end = ended(id);
    ASSERT_TRUE(end.state == JobState::kCancelled || end.state == JobState::kSucceeded);
    EXPECT_EQ(end.mesh.has_value(), end.state == JobState::kSucceeded);
    daemon().client().cancel(id);
    EXPECT_EQ(job(id), end);
  }
}

}  // namespace
}  // namespace isomesh
