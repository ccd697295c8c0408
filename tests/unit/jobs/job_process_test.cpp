#include "server/jobs/job_process.h"

#include <csignal>
#include <set>
#include <thread>

#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/support/errors.h"
#include "tests/support/process.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

class JobProcessTest : public test::JobsFixture {
 protected:
  JobOrder order_of(const Volume& volume, double iso) {
    Job job;
    job.id = "job";
    job.created = volume.created;
    job.parameters = parameters_of(volume, iso);
    return {.volume = blobs_.path_of(volume.id),
            .job = job,
            .iso = iso,
            .memory_bytes = std::uint64_t{1} << 30,
            .files = {data_.scratch() / ("made" + std::to_string(++made_))}};
  }

  const Report ignore_ = [](Stage, double, const Timing&) {};
  int made_ = 0;
  JobProcess process_{ISOMESH_JOB,
                      {.readable = data_.blobs(), .writable = data_.scratch(), .threads = 2}};
};

TEST_F(JobProcessTest, MakesOneMeshAfterTheOtherInTheSameProcess) {
  const Volume sphere = add_sphere();
  std::set<Stage> stages;
  std::set<pid_t> children;
  for (const double iso : {0.0, 0.5, 1.0}) {
    const JobOrder order = order_of(sphere, iso);
    const Job job =
        process_.run(order, {}, [&](Stage stage, double, const Timing&) { stages.insert(stage); });
    ASSERT_TRUE(job.mesh);
    EXPECT_GT(job.mesh->triangles, 0U);
    EXPECT_EQ(job.mesh->files.begin()->second.bytes, std::filesystem::file_size(order.files[0]));
    children.insert(process_.pid().value());
  }
  EXPECT_EQ(children.size(), 1U);
  EXPECT_TRUE(stages.contains(Stage::kExtract));
  EXPECT_TRUE(stages.contains(Stage::kEncode));
}

TEST_F(JobProcessTest, AJobThatIsStoppedEndsAndTheNextOneRuns) {
  const Volume much = add_much();
  JobOrder order = order_of(much, 50);
  order.job.parameters.passes = 1000;
  std::stop_source stop;
  const auto error = test::thrown_by([&] {
    process_.run(order, stop.get_token(), [&](Stage stage, double, const Timing&) {
      if (stage == Stage::kSmooth) stop.request_stop();
    });
  });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), ErrorCode::kCancelled);
  EXPECT_TRUE(process_.run(order_of(much, 50), {}, ignore_).mesh);
}

// The file is cut while it is mapped: the signal ends the process, and nothing else.
TEST_F(JobProcessTest, ADiskThatGivesWayEndsOneJob) {
  const Volume sphere = add_sphere();
  const Volume much = add_much();
  JobOrder order = order_of(much, 50);
  order.job.parameters.passes = 1000;
  const auto error = test::thrown_by([&] {
    process_.run(order, {}, [&](Stage stage, double, const Timing&) {
      if (stage == Stage::kLoad) std::filesystem::resize_file(order.volume, 4096);
    });
  });
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), ErrorCode::kInternal);
  EXPECT_TRUE(process_.run(order_of(sphere, 0), {}, ignore_).mesh);
}

TEST_F(JobProcessTest, AnIdleProcessThatDiedCostsNoJob) {
  const Volume sphere = add_sphere();
  process_.run(order_of(sphere, 0), {}, ignore_);
  const pid_t first = process_.pid().value();
  ::kill(first, SIGKILL);
  ASSERT_TRUE(test::eventually([&] { return !test::children_of(::getpid()).contains(first); }));
  EXPECT_TRUE(process_.run(order_of(sphere, 0.5), {}, ignore_).mesh);
}

}  // namespace
}  // namespace isomesh::jobs
