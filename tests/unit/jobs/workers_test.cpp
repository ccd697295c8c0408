#include "server/jobs/queue/workers.h"

#include <algorithm>
#include <atomic>
#include <functional>
#include <latch>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "base/log.h"
#include "proto/error.h"
#include "server/mesh/parallel.h"
#include "tests/support/process.h"
#include "tests/support/stores.h"
#include "tests/unit/jobs/faulty_job.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

using std::chrono::milliseconds;
using test::eventually;
using test::kLongest;

// A storage that fails while the daemon ends.
class FailingBlobs : public store::FileBlobStore {
 public:
  FailingBlobs(const store::DataFolder& data, ErrorCode code) : FileBlobStore(data), code_(code) {}

  bool is_intact(const std::string& /*key*/, const std::stop_token& stop) const override {
    asked_.count_down();
    Mutex mutex;
    Lock lock(mutex);
    Condition().wait(lock, stop, [] { return false; });
    throw Error(code_, "the storage fails");
  }
  void wait_until_asked() const { asked_.wait(); }

 private:
  const ErrorCode code_;
  mutable std::latch asked_{1};
};

// A storage that goes away as a job begins to read it. Counts how often it was found missing.
class LeavingBlobs : public store::FileBlobStore {
 public:
  using FileBlobStore::FileBlobStore;

  void leave_at_first_use(std::function<void()> leave) { leave_ = std::move(leave); }
  std::size_t times_missing() const { return times_missing_; }

  bool responds() const override {
    const bool responds = FileBlobStore::responds();
    times_missing_ += responds ? 0 : 1;
    return responds;
  }
  bool is_intact(const std::string& key, const std::stop_token& stop) const override {
    if (leave_) std::exchange(leave_, nullptr)();
    return FileBlobStore::is_intact(key, stop);
  }

 private:
  mutable std::function<void()> leave_;  // for one worker
  mutable std::atomic<std::size_t> times_missing_ = 0;
};

class WorkersTest : public test::JobsFixture {
 protected:
  WorkerOptions threads(std::size_t count) const {
    return {.threads = count, .program = job_program()};
  }

  std::string submit(const JobParameters& parameters) {
    return job_of(jobs_.submit({"", parameters, "", ""})).id;
  }

  // A job that runs for longer than any test waits for.
  std::string submit_long() {
    JobParameters parameters = parameters_of(add_much(), 50);
    parameters.passes = 1000;
    return submit(parameters);
  }

  bool comes_to(const std::string& id, JobState state) {
    return eventually([&] { return jobs_.get("", id).state == state; });
  }

  // True if it has run and waits for another run, which is soon.
  bool is_put_back_uncharged(const std::string& id) {
    const std::size_t events = jobs_.events("", id, 0, milliseconds(0)).size();
    const store::JobAccount account = jobs_.account(id);
    return events >= 3 && account.job.state == JobState::kQueued && account.attempts == 0;
  }

  // A job that runs as the storage goes away is put back uncharged. Another one is not tried until
  // the storage is back.
  void expect_to_wait(LeavingBlobs& blobs, const std::function<void()>& leave,
                      const std::function<void()>& come_back) {
    const Volume volume = add_sphere();
    const std::string running = submit(parameters_of(volume, 0));
    blobs.leave_at_first_use(leave);
    const Workers workers(threads(1), jobs_, volumes_, blobs);
    EXPECT_TRUE(eventually([&] { return is_put_back_uncharged(running); }));
    EXPECT_TRUE(eventually([&] { return blobs.times_missing() > 0; }));
    const std::string waiting = submit(parameters_of(volume, 0.1));
    const std::size_t times = blobs.times_missing();
    EXPECT_TRUE(eventually([&] { return blobs.times_missing() > times + 1; }));
    EXPECT_EQ(jobs_.events("", waiting, 0, milliseconds(0)).size(), 1U) << "no attempt";
    come_back();
    for (const std::string& id : {running, waiting}) {
      EXPECT_EQ(test::end_of(jobs_, "", id).state, JobState::kSucceeded);
      EXPECT_EQ(jobs_.account(id).attempts, 1);
    }
  }
};

// No mesh may come from samples that are not those that the volume's id names.
TEST_F(WorkersTest, AVolumeThatIsDamagedOnDiskFailsItsJob) {
  const Volume volume = add_sphere();
  for (const auto& damage : std::vector<std::function<void(std::string&)>>{
           [](std::string& bytes) { bytes.back() ^= 1; },
           [](std::string& bytes) { bytes.resize(bytes.size() / 2); },
           [](std::string& bytes) { bytes.clear(); }}) {
    std::string bytes = blob(volume.samples);
    damage(bytes);
    test::write_file(blobs_.path_of(volume.samples), bytes);
    const Workers workers(threads(1), jobs_, volumes_, blobs_);
    const Job job = test::end_of(jobs_, "", submit(parameters_of(volume, 0)));
    EXPECT_EQ(job.state, JobState::kFailed);
    ASSERT_TRUE(job.error);
    EXPECT_EQ(job.error->type, "urn:isomesh:problem:unusable-volume");
    EXPECT_EQ(job.error->instance, "/v1/jobs/" + job.id);
    EXPECT_FALSE(job.mesh);
    EXPECT_EQ(blob_count(), 1U);
  }
}

TEST_F(WorkersTest, AFailureOfOursTellsNothingAndIsTriedThreeTimes) {
  const Volume volume = add_sphere();
  std::filesystem::remove_all(data_.scratch());
  test::write_file(data_.scratch(), "where a folder should be");
  const Workers workers(threads(1), jobs_, volumes_, blobs_);
  const Job job = test::end_of(jobs_, "", submit(parameters_of(volume, 0)));
  EXPECT_EQ(job.state, JobState::kFailed);
  ASSERT_TRUE(job.error);
  EXPECT_EQ(job.error->status, 500);
  std::vector<store::Event> events;
  EXPECT_TRUE(eventually([&] {  // the state can be read shortly before the event of the end
    events = jobs_.events("", job.id, 0, milliseconds(0));
    return events.back().kind == store::EventKind::kDone;
  }));
  EXPECT_EQ(std::ranges::count(events, Stage::kLoad, &store::Event::stage), 3 + 1);
  EXPECT_EQ(job.error->detail.find(folder_.path()), std::string::npos);
}

TEST_F(WorkersTest, RoomForAMeshIsMadeForTheOwnerOfItsJob) {
  const Volume volume = add_sphere();
  volumes_.add("other", volume);
  add_much();  // the mesh would fit in its place
  std::string asked;
  blobs_.limit_room(blobs_.bytes() + 1, [&](const store::Incoming& incoming) {
    asked = incoming.owner;
    throw Error(ErrorCode::kTooLarge, "no room");
  });
  const std::string id = job_of(jobs_.submit({"other", parameters_of(volume, 0), "", ""})).id;
  {
    const Workers workers(threads(1), jobs_, volumes_, blobs_);
    EXPECT_EQ(test::end_of(jobs_, "other", id).state, JobState::kFailed);
  }
  EXPECT_EQ(asked, "other");
}

// The service is at fault, and not for long.
TEST_F(WorkersTest, AJobThatFindsNoDescriptorIsPutBackUncharged) {
  const std::string id = submit(parameters_of(add_sphere(), 0));
  rlimit before = {};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  const rlimit none = {3, before.rlim_max};
  // The sanitizer needs a descriptor for anything that it has not seen yet, so the log is used
  // beforehand.
  log_info("no descriptors from now on");
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  const Workers workers(threads(1), jobs_, volumes_, blobs_);
  const bool is_put_back = eventually([&] {
    try {
      return is_put_back_uncharged(id);
    } catch (const Error& error) {  // whoever asks finds no descriptor either
      return error.code() != ErrorCode::kUnavailable;
    }
  });
  ::setrlimit(RLIMIT_NOFILE, &before);
  EXPECT_TRUE(is_put_back);
}

// A shared folder that is not mounted for a while damages no volume.
TEST_F(WorkersTest, AJobWaitsUnchargedForAFolderThatIsMovedAway) {
  std::filesystem::create_directory(folder_ / "shared");
  LeavingBlobs shared(store::shared_blob_folders(folder_ / "shared"), data_.reserve());
  shared.set_mark("ours 1\n");
  test::put(shared, blob(add_sphere().samples));
  expect_to_wait(
      shared, [&] { std::filesystem::rename(folder_ / "shared", folder_ / "elsewhere"); },
      [&] { std::filesystem::rename(folder_ / "elsewhere", folder_ / "shared"); });
}

// So does the data folder: while another is in its place, too.
TEST_F(WorkersTest, AJobWaitsUnchargedForADataFolderThatIsMovedAway) {
  const std::filesystem::path place = folder_ / "data";
  LeavingBlobs blobs(data_);
  expect_to_wait(
      blobs,
      [&] {
        std::filesystem::rename(place, folder_ / "elsewhere");
        std::filesystem::create_directory(place);
      },
      [&] {
        EXPECT_TRUE(std::filesystem::is_empty(place));
        std::filesystem::remove(place);
        std::filesystem::rename(folder_ / "elsewhere", place);
      });
}

TEST_F(WorkersTest, AJobWhoseStorageFailsWhileTheDaemonEndsIsPutBackUncharged) {
  const Volume volume = add_sphere();
  for (const ErrorCode code : {ErrorCode::kUnavailable, ErrorCode::kOutOfSpace}) {
    const std::string id = submit(parameters_of(volume, 0));
    {
      FailingBlobs failing(data_, code);
      const Workers workers(threads(1), jobs_, volumes_, failing);
      failing.wait_until_asked();
    }
    EXPECT_EQ(jobs_.get("", id).state, JobState::kQueued);
    EXPECT_EQ(jobs_.account(id).attempts, 0);
    jobs_.cancel("", id);
  }
}

// As when its spool finds no room.
TEST_F(WorkersTest, AJobWhoseProcessFindsTheDiskFullWaitsUncharged) {
  WorkerOptions options = threads(1);
  options.program = job_program(FAULTY_JOB);
  const std::string id = submit(parameters_of(add_sphere(), test::kHasNoRoom));
  const Workers workers(options, jobs_, volumes_, blobs_);
  EXPECT_TRUE(eventually([&] { return is_put_back_uncharged(id); }));
  EXPECT_EQ(jobs_.get("", id).waiting_for, WaitingFor::kDisk);
}

TEST_F(WorkersTest, AJobThatTakesTooLongFails) {
  WorkerOptions options = threads(1);
  options.longest_job = std::chrono::minutes(0);
  const Workers workers(options, jobs_, volumes_, blobs_);
  const Job job = test::end_of(jobs_, "", submit_long());
  EXPECT_EQ(job.state, JobState::kFailed);
  ASSERT_TRUE(job.error);
  EXPECT_EQ(job.error->status, 413);
}

TEST_F(WorkersTest, ALeaseIsProlongedWhileItsJobRuns) {
  WorkerOptions options = threads(1);
  options.lease = std::chrono::seconds(10);
  options.program = job_program(FAULTY_JOB);
  const Workers workers(options, jobs_, volumes_, blobs_);
  const std::string id = submit(parameters_of(add_sphere(), test::kIsDeaf));
  ASSERT_TRUE(comes_to(id, JobState::kRunning));
  const auto past = std::chrono::steady_clock::now() + options.lease + std::chrono::seconds(1);
  EXPECT_TRUE(eventually([&] { return std::chrono::steady_clock::now() > past; }));
  EXPECT_EQ(jobs_.reap(), 0U);
  EXPECT_EQ(jobs_.account(id).attempts, 1);
  EXPECT_EQ(jobs_.get("", id).state, JobState::kRunning);
  jobs_.cancel("", id);
}

TEST_F(WorkersTest, ARunningJobTellsItsProgress) {
  const Workers workers(threads(1), jobs_, volumes_, blobs_);
  const std::string id = submit_long();
  ASSERT_TRUE(eventually([&] { return jobs_.get("", id).stage == Stage::kSmooth; }));
  const Job early = jobs_.get("", id);
  EXPECT_GT(early.progress, 0);
  EXPECT_GT(early.timing.extract, 0);
  EXPECT_TRUE(eventually([&] { return jobs_.get("", id).progress > early.progress; }));
  jobs_.cancel("", id);
}

TEST_F(WorkersTest, DrainLetsARunningJobFinishAndBeginsNoOther) {
  JobParameters parameters = parameters_of(add_much(), 50);
  parameters.passes = 40;
  parameters.formats = {MeshFormat::kStl};  // Draco's would take long where all processors are busy
  const JobParameters others = parameters_of(add_sphere(), 0);
  const std::string running = submit(parameters);
  const std::string waiting = submit(others);
  std::optional<Workers> workers(std::in_place, threads(1), jobs_, volumes_, blobs_);
  ASSERT_TRUE(comes_to(running, JobState::kRunning));
  EXPECT_TRUE(workers->drain(kLongest));
  EXPECT_EQ(jobs_.get("", running).state, JobState::kSucceeded);
  EXPECT_EQ(jobs_.get("", waiting).state, JobState::kQueued);
  workers.reset();
  EXPECT_EQ(jobs_.get("", waiting).state, JobState::kQueued);
}

}  // namespace
}  // namespace isomesh::jobs
