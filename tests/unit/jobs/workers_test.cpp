#include "server/jobs/workers.h"

#include <algorithm>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>
#include <sys/resource.h>

#include "base/log.h"
#include "server/mesh/parallel.h"
#include "tests/support/jobs.h"
#include "tests/support/process.h"
#include "tests/unit/jobs/faulty_job.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

using std::chrono::milliseconds;
using test::eventually;
using test::kLongest;

class WorkersTest : public test::JobsFixture {
 protected:
  WorkerOptions threads(std::size_t count, const char* program = ISOMESH_JOB) const {
    return {.threads = count, .program = job_program(program)};
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
};

TEST_F(WorkersTest, RunAJobToItsMesh) {
  const Workers workers(threads(1), jobs_, volumes_, blobs_);
  JobParameters parameters = parameters_of(add_sphere(), 0);
  parameters.formats = {MeshFormat::kDrc, MeshFormat::kStl};
  const Job job = test::end_of(jobs_, "", submit(parameters));
  ASSERT_EQ(job.state, JobState::kSucceeded);
  EXPECT_EQ(job.progress, 1);
  EXPECT_EQ(job.mesh->files.at(MeshFormat::kDrc).href, "/v1/jobs/" + job.id + "/mesh.drc");
  EXPECT_EQ(job.mesh->files.at(MeshFormat::kStl).href, "/v1/jobs/" + job.id + "/mesh.stl");
  EXPECT_TRUE(job.started && job.finished);
  const Timing& timing = job.timing;
  for (const double stage :
       {timing.queue, timing.load, timing.extract, timing.smooth, timing.encode}) {
    EXPECT_GT(stage, 0);
    EXPECT_LE(stage, timing.total);
  }
  EXPECT_GE(timing.total,
            timing.queue + timing.load + timing.extract + timing.smooth + timing.encode - 0.01);
}

// No mesh may come from samples that are not those that the volume's id names.
TEST_F(WorkersTest, AVolumeThatIsDamagedOnDiskFailsItsJob) {
  const Volume volume = add_sphere();
  for (const auto& damage : std::vector<std::function<void(std::string&)>>{
           [](std::string& bytes) { bytes.back() ^= 1; },
           [](std::string& bytes) { bytes.resize(bytes.size() / 2); },
           [](std::string& bytes) { bytes.clear(); }}) {
    std::string bytes = blob(volume.id);
    damage(bytes);
    test::write_file(blobs_.path_of(volume.id), bytes);
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
  const auto events = jobs_.events("", job.id, 0, milliseconds(0));
  EXPECT_EQ(std::ranges::count(events, Stage::kLoad, &store::Event::stage), 3 + 1);
  EXPECT_EQ(job.error->detail.find(folder_.path()), std::string::npos);
}

// The service is at fault, and not for long.
TEST_F(WorkersTest, AJobThatFindsNoDescriptorIsPutBackUncharged) {
  const std::string id = submit(parameters_of(add_sphere(), 0));
  rlimit before = {};
  ASSERT_EQ(::getrlimit(RLIMIT_NOFILE, &before), 0);
  const rlimit none = {3, before.rlim_max};
  // What the sanitizer has not seen yet it looks at by a descriptor: so the log has been used.
  log_info("no descriptors from now on");
  ASSERT_EQ(::setrlimit(RLIMIT_NOFILE, &none), 0);
  const Workers workers(threads(1), jobs_, volumes_, blobs_);
  const bool is_put_back = eventually([&] {
    try {
      const auto events = jobs_.events("", id, 0, milliseconds(0));
      return events.size() >= 3 && jobs_.get("", id).state != JobState::kRunning;
    } catch (const Error& error) {  // whoever asks finds no descriptor either
      return error.code() != ErrorCode::kUnavailable;
    }
  });
  ::setrlimit(RLIMIT_NOFILE, &before);
  EXPECT_TRUE(is_put_back);
  const store::JobAccount account = jobs_.account(id);
  EXPECT_EQ(account.job.state, JobState::kQueued);
  EXPECT_EQ(account.attempts, 0);
}

TEST_F(WorkersTest, GoOnAfterAFailure) {
  const Workers workers(threads(1), jobs_, volumes_, blobs_);
  const Volume spoilt = add_sphere();
  const std::string intact = blob(spoilt.id);
  test::write_file(blobs_.path_of(spoilt.id), "spoilt by the disk");
  EXPECT_EQ(test::end_of(jobs_, "", submit(parameters_of(spoilt, 0))).state, JobState::kFailed);
  test::write_file(blobs_.path_of(spoilt.id), intact);
  EXPECT_EQ(test::end_of(jobs_, "", submit(parameters_of(spoilt, 0))).state, JobState::kSucceeded);
}

// Each of another owner, because one owner's jobs alike are computed once.
TEST_F(WorkersTest, ManyJobsAtATimeGiveEachItsOwnMesh) {
  const Volume volume = add_sphere();
  std::vector<std::string> ids;
  {
    const Workers workers(threads(4), jobs_, volumes_, blobs_);
    for (int n = 0; n < 24; ++n) {
      const std::string owner = "owner " + std::to_string(n);
      volumes_.add(owner, volume);
      ids.push_back(job_of(jobs_.submit({owner, parameters_of(volume, n % 3), "", ""})).id);
    }
    for (const std::string& id : ids) test::end_of(jobs_, std::nullopt, id);
  }
  std::vector<Job> first;
  for (const std::string& id : ids) {
    const Job job = jobs_.get(std::nullopt, id);
    ASSERT_EQ(job.state, JobState::kSucceeded);
    EXPECT_FALSE(job.reused);
    if (first.size() < 3) first.push_back(job);
    const std::size_t kind = (&id - ids.data()) % 3;
    EXPECT_EQ(job.mesh->files.at(MeshFormat::kDrc).sha256,
              first[kind].mesh->files.at(MeshFormat::kDrc).sha256);
  }
  EXPECT_NE(first[0].mesh->triangles, first[1].mesh->triangles);
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
  options.lease = std::chrono::seconds(1);
  const Workers workers(options, jobs_, volumes_, blobs_);
  const std::string id = submit_long();
  ASSERT_TRUE(comes_to(id, JobState::kRunning));
  const auto past = std::chrono::steady_clock::now() + 2 * options.lease;
  EXPECT_TRUE(eventually([&] { return std::chrono::steady_clock::now() > past; }));
  EXPECT_EQ(jobs_.reap(), 0U);
  EXPECT_EQ(jobs_.account(id).attempts, 1);
  EXPECT_EQ(jobs_.get("", id).state, JobState::kRunning);
  jobs_.cancel("", id);
}

TEST_F(WorkersTest, ARunningJobStopsWhenItIsCancelled) {
  const Workers workers(threads(1), jobs_, volumes_, blobs_);
  const std::string id = submit_long();
  ASSERT_TRUE(eventually([&] { return jobs_.get("", id).stage == Stage::kSmooth; }));
  const std::size_t before = blob_count();
  jobs_.cancel("", id);
  const Job job = test::end_of(jobs_, "", id);
  EXPECT_EQ(job.state, JobState::kCancelled);
  EXPECT_FALSE(job.mesh || job.error);
  EXPECT_EQ(blob_count(), before);
}

// It cannot be interrupted, so it is killed; the next job gets another process.
TEST_F(WorkersTest, AJobThatDoesNotStopIsKilledWhenItIsCancelled) {
  const Workers workers(threads(1, FAULTY_JOB), jobs_, volumes_, blobs_);
  const Volume volume = add_sphere();
  const std::string deaf = submit(parameters_of(volume, test::kIsDeaf));
  ASSERT_TRUE(eventually([&] { return jobs_.get("", deaf).stage == Stage::kEncode; }));
  jobs_.cancel("", deaf);
  EXPECT_EQ(test::end_of(jobs_, "", deaf).state, JobState::kCancelled);
  const Job next = test::end_of(jobs_, "", submit(parameters_of(volume, test::kAnswers)));
  EXPECT_EQ(next.state, JobState::kSucceeded);
}

// A stream of libdraco's takes seconds, in which nothing is looked at.
TEST_F(WorkersTest, AJobStopsInTheMiddleOfAStream) {
  const Workers workers(threads(1), jobs_, volumes_, blobs_);
  JobParameters parameters = parameters_of(add_much(), 50);
  parameters.passes = 0;
  parameters.draco.speed = 0;
  const std::string id = submit(parameters);
  ASSERT_TRUE(eventually([&] { return jobs_.get("", id).stage == Stage::kEncode; }));
  jobs_.cancel("", id);
  EXPECT_EQ(test::end_of(jobs_, "", id).state, JobState::kCancelled);
  EXPECT_EQ(blob_count(), 1U);
  EXPECT_TRUE(eventually([&] { return scratch_count() == 0; }));
}

TEST_F(WorkersTest, AProcessThatDiesIsChargedToItsJobAlone) {
  const Workers workers(threads(2, FAULTY_JOB), jobs_, volumes_, blobs_);
  const Volume volume = add_sphere();
  const std::string neighbour = submit(parameters_of(volume, test::kIsDeaf));
  ASSERT_TRUE(eventually([&] { return jobs_.get("", neighbour).stage == Stage::kEncode; }));
  const auto started = jobs_.get("", neighbour).started;
  const std::string deadly = submit(parameters_of(volume, test::kKilled));
  const Job job = test::end_of(jobs_, "", deadly);
  EXPECT_EQ(job.state, JobState::kFailed);
  ASSERT_TRUE(job.error);
  EXPECT_EQ(job.error->status, 500);
  EXPECT_EQ(job.error->detail,
            "The job process ended with signal 9 (killed) in the stage \"encode\".");
  EXPECT_EQ(jobs_.account(deadly).attempts, 3);
  EXPECT_EQ(jobs_.get("", neighbour).state, JobState::kRunning);
  EXPECT_EQ(jobs_.get("", neighbour).started, started);
  EXPECT_EQ(jobs_.account(neighbour).attempts, 1);
  jobs_.cancel("", neighbour);
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
  std::optional<Workers> workers(std::in_place, threads(1), jobs_, volumes_, blobs_);
  JobParameters parameters = parameters_of(add_much(), 50);
  parameters.passes = 40;
  parameters.formats = {MeshFormat::kStl};  // Draco's would take long where all processors are busy
  const std::string running = submit(parameters);
  ASSERT_TRUE(comes_to(running, JobState::kRunning));
  const std::string waiting = submit(parameters_of(add_sphere(), 0));
  EXPECT_TRUE(workers->drain(kLongest));
  EXPECT_EQ(jobs_.get("", running).state, JobState::kSucceeded);
  EXPECT_EQ(jobs_.get("", waiting).state, JobState::kQueued);
  workers.reset();
  EXPECT_EQ(jobs_.get("", waiting).state, JobState::kQueued);
}

TEST_F(WorkersTest, AJobThatOutlastsTheDrainIsPutBack) {
  std::optional<Workers> workers(std::in_place, threads(1), jobs_, volumes_, blobs_);
  const std::string id = submit_long();
  ASSERT_TRUE(comes_to(id, JobState::kRunning));
  EXPECT_FALSE(workers->drain(milliseconds(1)));
  workers.reset();
  const Job job = jobs_.get("", id);
  EXPECT_EQ(job.state, JobState::kQueued);
  EXPECT_EQ(job.progress, 0);
  EXPECT_EQ(scratch_count(), 0U);
}

TEST_F(WorkersTest, DrainingIdleOnesIsDoneAtOnce) {
  Workers workers(threads(3), jobs_, volumes_, blobs_);
  EXPECT_TRUE(workers.drain(kLongest));
  EXPECT_TRUE(workers.drain(milliseconds(0)));
}

}  // namespace
}  // namespace isomesh::jobs
