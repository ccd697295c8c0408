#include "server/jobs/workers.h"

#include <optional>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "server/mesh/context.h"
#include "tests/support/process.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

using std::chrono::milliseconds;
using test::eventually;
using test::kLongest;

class WorkersTest : public test::JobsFixture {
 protected:
  std::string submit(const JobParameters& parameters) { return jobs_.submit(parameters).id; }

  // A job that runs for longer than any test waits for.
  std::string submit_long() {
    JobParameters parameters = parameters_of(add_much(), 50);
    parameters.passes = 1000;
    return submit(parameters);
  }

  bool comes_to(const std::string& id, JobState state) {
    return eventually([&] { return jobs_.get(id).state == state; });
  }
};

TEST_F(WorkersTest, RunAJobToItsMesh) {
  const Workers workers(1, jobs_, volumes_, blobs_, {});
  JobParameters parameters = parameters_of(add_sphere(), 0);
  parameters.formats = {MeshFormat::kDrc, MeshFormat::kStl};
  const Job job = jobs_.wait(submit(parameters), kLongest);
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

TEST_F(WorkersTest, AJobWithoutAVolumeFailsWithAProblem) {
  const Workers workers(1, jobs_, volumes_, blobs_, {});
  JobParameters parameters;
  parameters.volume = "gone";
  parameters.iso = 1;
  const Job job = jobs_.wait(submit(parameters), kLongest);
  EXPECT_EQ(job.state, JobState::kFailed);
  ASSERT_TRUE(job.error);
  EXPECT_EQ(job.error->type, "urn:isomesh:problem:not-found");
  EXPECT_EQ(job.error->instance, "/v1/jobs/" + job.id);
  EXPECT_FALSE(job.mesh);
}

TEST_F(WorkersTest, AFailureTellsNothingOfTheMachine) {
  const Volume volume = add_sphere();
  test::write_file(blobs_.path_of(volume.id), "spoilt by the disk");
  const Workers workers(1, jobs_, volumes_, blobs_, {});
  const Job job = jobs_.wait(submit(parameters_of(volume, 0)), kLongest);
  EXPECT_EQ(job.state, JobState::kFailed);
  ASSERT_TRUE(job.error);
  EXPECT_EQ(job.error->status, 500);
  EXPECT_EQ(job.error->detail.find(folder_.path()), std::string::npos);
}

TEST_F(WorkersTest, GoOnAfterAFailure) {
  const Workers workers(1, jobs_, volumes_, blobs_, {});
  JobParameters unknown;
  unknown.volume = "gone";
  submit(unknown);
  EXPECT_EQ(jobs_.wait(submit(parameters_of(add_sphere(), 0)), kLongest).state,
            JobState::kSucceeded);
}

TEST_F(WorkersTest, ManyJobsAtATimeGiveEachItsOwnMesh) {
  const Volume volume = add_sphere();
  std::vector<std::string> ids;
  {
    const Workers workers(4, jobs_, volumes_, blobs_, {});
    for (int n = 0; n < 24; ++n) ids.push_back(submit(parameters_of(volume, n % 3)));
    for (const std::string& id : ids) jobs_.wait(id, kLongest);
  }
  std::vector<Job> first;
  for (const std::string& id : ids) {
    const Job job = jobs_.get(id);
    ASSERT_EQ(job.state, JobState::kSucceeded);
    if (first.size() < 3) first.push_back(job);
    const std::size_t kind = (&id - ids.data()) % 3;
    EXPECT_EQ(job.mesh->files.at(MeshFormat::kDrc).sha256,
              first[kind].mesh->files.at(MeshFormat::kDrc).sha256);
  }
  EXPECT_NE(first[0].mesh->triangles, first[1].mesh->triangles);
}

TEST_F(WorkersTest, ARunningJobStopsWhenItIsCancelled) {
  const Workers workers(1, jobs_, volumes_, blobs_, {});
  const std::string id = submit_long();
  ASSERT_TRUE(eventually([&] { return jobs_.get(id).stage == Stage::kSmooth; }));
  const std::size_t before = blob_count();
  jobs_.cancel(id);
  const Job job = jobs_.wait(id, kLongest);
  EXPECT_EQ(job.state, JobState::kCancelled);
  EXPECT_FALSE(job.mesh || job.error);
  EXPECT_EQ(blob_count(), before);
}

TEST_F(WorkersTest, ARunningJobTellsItsProgress) {
  const Workers workers(1, jobs_, volumes_, blobs_, {});
  const std::string id = submit_long();
  ASSERT_TRUE(eventually([&] { return jobs_.get(id).stage == Stage::kSmooth; }));
  const Job early = jobs_.get(id);
  EXPECT_GT(early.progress, 0);
  EXPECT_GT(early.timing.extract, 0);
  EXPECT_TRUE(eventually([&] { return jobs_.get(id).progress > early.progress; }));
  jobs_.cancel(id);
}

TEST_F(WorkersTest, DrainLetsARunningJobFinishAndBeginsNoOther) {
  std::optional<Workers> workers(std::in_place, 1, jobs_, volumes_, blobs_, PipelineLimits{});
  JobParameters parameters = parameters_of(add_much(), 50);
  parameters.passes = 40;
  const std::string running = submit(parameters);
  ASSERT_TRUE(comes_to(running, JobState::kRunning));
  const std::string waiting = submit(parameters_of(add_sphere(), 0));
  EXPECT_TRUE(workers->drain(kLongest));
  EXPECT_EQ(jobs_.get(running).state, JobState::kSucceeded);
  EXPECT_EQ(jobs_.get(waiting).state, JobState::kQueued);
  workers.reset();
  EXPECT_EQ(jobs_.get(waiting).state, JobState::kQueued);
}

TEST_F(WorkersTest, AJobThatOutlastsTheDrainIsPutBack) {
  std::optional<Workers> workers(std::in_place, 1, jobs_, volumes_, blobs_, PipelineLimits{});
  const std::string id = submit_long();
  ASSERT_TRUE(comes_to(id, JobState::kRunning));
  EXPECT_FALSE(workers->drain(milliseconds(1)));
  workers.reset();
  const Job job = jobs_.get(id);
  EXPECT_EQ(job.state, JobState::kQueued);
  EXPECT_EQ(job.progress, 0);
  EXPECT_EQ(scratch_count(), 0U);
}

TEST_F(WorkersTest, DrainingIdleOnesIsDoneAtOnce) {
  Workers workers(3, jobs_, volumes_, blobs_, {});
  EXPECT_TRUE(workers.drain(kLongest));
  EXPECT_TRUE(workers.drain(milliseconds(0)));
}

}  // namespace
}  // namespace isomesh::jobs
