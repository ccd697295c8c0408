#include "server/store/job_store.h"

#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/errors.h"
#include "tests/support/files.h"
#include "tests/support/process.h"

namespace isomesh::store {
namespace {

using std::chrono::milliseconds;
using test::as_span;
using test::code_thrown_by;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr milliseconds kNever{0};
constexpr milliseconds kLong{60'000};

class JobStoreTest : public testing::Test {
 protected:
  static JobParameters parameters(Priority priority = Priority::kRoutine) {
    JobParameters result;
    result.volume = "some volume";
    result.iso = 60;
    result.priority = priority;
    return result;
  }

  // Takes the next job; there must be one.
  static Lease claimed(JobStore& jobs) { return jobs.claim({}).value(); }

  static bool has_work(JobStore& jobs) { return !jobs.list(JobState::kQueued, "", 1).empty(); }

  std::string blob(std::string_view text) {
    BlobStore::Writer writer(blobs_);
    writer.write(as_span(text));
    return writer.commit().key;
  }

  bool has_blob(const std::string& key) { return std::filesystem::exists(blobs_.path_of(key)); }

  static Outcome mesh_of(const std::vector<std::string>& keys) {
    Outcome outcome;
    outcome.mesh.emplace().triangles = 12;
    for (std::size_t n = 0; n < keys.size(); ++n) {
      outcome.mesh->files[MeshFormat{static_cast<int>(n)}].sha256 = keys[n];
    }
    return outcome;
  }

  static Outcome failure() {
    Outcome outcome;
    outcome.error = to_problem(Error(ErrorCode::kTooLarge, "too large"), "/v1/jobs/x");
    return outcome;
  }

  static std::vector<std::string> ids_of(const std::vector<Job>& jobs) {
    std::vector<std::string> ids;
    for (const Job& job : jobs) ids.push_back(job.id);
    return ids;
  }

  test::TemporaryFolder folder_;
  DataFolder data_{folder_ / "data"};
  BlobStore blobs_{data_};
  JobStore jobs_{blobs_, JobStore::Limits{}};
};

// --- Submitting and claiming
// -----------------------------------------------------------------------

TEST_F(JobStoreTest, ASubmittedJobIsQueued) {
  const Job job = jobs_.submit(parameters(Priority::kBulk));
  EXPECT_EQ(job.state, JobState::kQueued);
  EXPECT_EQ(job.stage, Stage::kQueue);
  EXPECT_EQ(job.progress, 0);
  EXPECT_EQ(job.parameters, parameters(Priority::kBulk));
  EXPECT_FALSE(job.created.empty());
  EXPECT_FALSE(job.started || job.finished || job.mesh || job.error);
  EXPECT_EQ(job.timing, Timing{});
  EXPECT_EQ(jobs_.get(job.id), job);
}

TEST_F(JobStoreTest, AnUnknownJobIsNotFound) {
  EXPECT_EQ(code_thrown_by([&] { jobs_.get("x"); }), ErrorCode::kNotFound);
  EXPECT_EQ(code_thrown_by([&] { jobs_.cancel("x"); }), ErrorCode::kNotFound);
  EXPECT_EQ(code_thrown_by([&] { jobs_.wait("x", kLong); }), ErrorCode::kNotFound);
}

TEST_F(JobStoreTest, ClaimsByPriorityThenAge) {
  std::vector<std::string> expected;
  const std::string bulk = jobs_.submit(parameters(Priority::kBulk)).id;
  for (int n = 0; n < 20; ++n) expected.push_back(jobs_.submit(parameters()).id);
  const std::string other_bulk = jobs_.submit(parameters(Priority::kBulk)).id;
  expected.insert(expected.begin(), jobs_.submit(parameters(Priority::kStat)).id);
  expected.insert(expected.begin() + 1, jobs_.submit(parameters(Priority::kStat)).id);
  expected.insert(expected.end(), {bulk, other_bulk});
  std::vector<std::string> order;
  while (has_work(jobs_)) order.push_back(claimed(jobs_).id);
  EXPECT_EQ(order, expected);
}

TEST_F(JobStoreTest, AClaimedJobRuns) {
  const std::string id = jobs_.submit(parameters()).id;
  const Lease lease = claimed(jobs_);
  EXPECT_EQ(lease.id, id);
  EXPECT_EQ(lease.parameters, parameters());
  EXPECT_FALSE(lease.cancelled.stop_requested());
  const Job job = jobs_.get(id);
  EXPECT_EQ(job.state, JobState::kRunning);
  EXPECT_TRUE(job.started);
  EXPECT_FALSE(job.finished);
}

TEST_F(JobStoreTest, ClaimWaitsForAJob) {
  std::optional<Lease> lease;
  std::jthread worker([&] { lease = jobs_.claim({}); });
  const std::string id = jobs_.submit(parameters()).id;
  worker.join();
  ASSERT_TRUE(lease);
  EXPECT_EQ(lease->id, id);
}

TEST_F(JobStoreTest, ClaimEndsWhenItIsStopped) {
  std::stop_source stop;
  std::optional<Lease> lease;
  std::jthread worker([&] { lease = jobs_.claim(stop.get_token()); });
  stop.request_stop();
  worker.join();
  EXPECT_FALSE(lease);
  jobs_.submit(parameters());
  EXPECT_FALSE(jobs_.claim(stop.get_token()));
  EXPECT_TRUE(has_work(jobs_));
}

// --- Running
// -----------------------------------------------------------------------------------------

TEST_F(JobStoreTest, AReportIsSeen) {
  const std::string id = jobs_.submit(parameters()).id;
  const Lease lease = claimed(jobs_);
  const double queued = jobs_.get(id).timing.queue;
  EXPECT_TRUE(jobs_.report(lease, Stage::kSmooth, 0.4, {.load = 1, .extract = 2}));
  const Job job = jobs_.get(id);
  EXPECT_EQ(job.stage, Stage::kSmooth);
  EXPECT_EQ(job.progress, 0.4);
  EXPECT_EQ(job.timing.load, 1);
  EXPECT_EQ(job.timing.extract, 2);
  EXPECT_EQ(job.timing.queue, queued);
}

TEST_F(JobStoreTest, AMeshEndsItSucceeded) {
  const std::string id = jobs_.submit(parameters()).id;
  EXPECT_TRUE(jobs_.finish(claimed(jobs_), mesh_of({"k"}), {.load = 1, .encode = 4}));
  const Job job = jobs_.get(id);
  EXPECT_EQ(job.state, JobState::kSucceeded);
  EXPECT_EQ(job.stage, Stage::kDone);
  EXPECT_EQ(job.progress, 1);
  EXPECT_EQ(job.mesh->triangles, 12U);
  EXPECT_TRUE(job.started && job.finished);
  EXPECT_EQ(job.timing.encode, 4);
  EXPECT_GE(job.timing.total, job.timing.queue);
  EXPECT_GT(job.timing.total, 0);
}

TEST_F(JobStoreTest, AnErrorEndsItFailed) {
  const std::string id = jobs_.submit(parameters()).id;
  const Lease lease = claimed(jobs_);
  jobs_.report(lease, Stage::kExtract, 0.1, {});
  EXPECT_TRUE(jobs_.finish(lease, failure(), {}));
  const Job job = jobs_.get(id);
  EXPECT_EQ(job.state, JobState::kFailed);
  EXPECT_EQ(job.stage, Stage::kExtract);
  EXPECT_EQ(job.error->detail, "too large");
  EXPECT_FALSE(job.mesh);
}

TEST_F(JobStoreTest, FencesGrow) {
  jobs_.submit(parameters());
  jobs_.submit(parameters());
  const Lease first = claimed(jobs_);
  EXPECT_GT(claimed(jobs_).fence, first.fence);
  jobs_.put_back(first);
  EXPECT_GT(claimed(jobs_).fence, first.fence + 1);
}

TEST_F(JobStoreTest, AFinishedJobTakesNoLateNews) {
  const std::string id = jobs_.submit(parameters()).id;
  const Lease lease = claimed(jobs_);
  jobs_.finish(lease, mesh_of({"k"}), {});
  const Job ended = jobs_.get(id);
  EXPECT_FALSE(jobs_.report(lease, Stage::kLoad, 0.1, {}));
  EXPECT_FALSE(jobs_.finish(lease, failure(), {}));
  jobs_.put_back(lease);
  EXPECT_EQ(jobs_.get(id), ended);
  EXPECT_FALSE(has_work(jobs_));
}

TEST_F(JobStoreTest, WhoeverLostTheLeaseCanNeitherReportNorFinish) {
  const std::string id = jobs_.submit(parameters()).id;
  const Lease late = claimed(jobs_);
  jobs_.put_back(late);
  EXPECT_FALSE(jobs_.report(late, Stage::kEncode, 0.9, {}));
  EXPECT_FALSE(jobs_.finish(late, mesh_of({"k"}), {}));
  EXPECT_EQ(jobs_.get(id).state, JobState::kQueued);

  const Lease lease = claimed(jobs_);
  EXPECT_FALSE(jobs_.report(late, Stage::kEncode, 0.9, {}));
  EXPECT_FALSE(jobs_.finish(late, failure(), {}));
  jobs_.put_back(late);
  EXPECT_EQ(jobs_.get(id).state, JobState::kRunning);
  EXPECT_EQ(jobs_.get(id).stage, Stage::kLoad);
  EXPECT_TRUE(jobs_.finish(lease, mesh_of({"k"}), {}));
}

TEST_F(JobStoreTest, AJobThatIsPutBackIsAsIfItHadNotRun) {
  const Job job = jobs_.submit(parameters());
  const std::string next = jobs_.submit(parameters()).id;
  const Lease lease = claimed(jobs_);
  jobs_.report(lease, Stage::kSmooth, 0.5, {.load = 3});
  jobs_.put_back(lease);
  EXPECT_EQ(jobs_.get(job.id), job);
  EXPECT_EQ(claimed(jobs_).id, job.id);
  EXPECT_EQ(claimed(jobs_).id, next);
}

// --- Cancelling
// --------------------------------------------------------------------------------------

TEST_F(JobStoreTest, ACancelledQueuedJobNeverRuns) {
  const std::string id = jobs_.submit(parameters()).id;
  const std::string next = jobs_.submit(parameters()).id;
  EXPECT_EQ(jobs_.cancel(id).state, JobState::kCancelled);
  EXPECT_TRUE(jobs_.get(id).finished);
  EXPECT_EQ(claimed(jobs_).id, next);
  EXPECT_FALSE(has_work(jobs_));
}

TEST_F(JobStoreTest, ACancelledRunningJobIsAskedToStop) {
  const std::string id = jobs_.submit(parameters()).id;
  const Lease lease = claimed(jobs_);
  EXPECT_EQ(jobs_.cancel(id).state, JobState::kRunning);
  EXPECT_TRUE(lease.cancelled.stop_requested());
  EXPECT_TRUE(jobs_.finish(lease, {}, {}));
  EXPECT_EQ(jobs_.get(id).state, JobState::kCancelled);
}

TEST_F(JobStoreTest, AJobThatWasAskedToStopEndsCancelledWhateverItsOutcome) {
  for (const Outcome& outcome : {mesh_of({"k"}), failure()}) {
    const std::string id = jobs_.submit(parameters()).id;
    const Lease lease = claimed(jobs_);
    jobs_.cancel(id);
    EXPECT_TRUE(jobs_.finish(lease, outcome, {}));
    const Job job = jobs_.get(id);
    EXPECT_EQ(job.state, JobState::kCancelled);
    EXPECT_FALSE(job.mesh || job.error);
  }
}

TEST_F(JobStoreTest, ACancelledJobsMeshIsErased) {
  const std::string key = blob("mesh");
  const std::string id = jobs_.submit(parameters()).id;
  const Lease lease = claimed(jobs_);
  jobs_.cancel(id);
  jobs_.finish(lease, mesh_of({key}), {});
  EXPECT_FALSE(has_blob(key));
}

TEST_F(JobStoreTest, AFinishedJobStaysAsItIs) {
  const std::string id = jobs_.submit(parameters()).id;
  jobs_.finish(claimed(jobs_), mesh_of({"k"}), {});
  const Job ended = jobs_.get(id);
  EXPECT_EQ(jobs_.cancel(id), ended);
  EXPECT_EQ(jobs_.get(id), ended);
}

// It was asked to stop before it was put back, and nobody else would do so again.
TEST_F(JobStoreTest, ACancelledJobThatIsPutBackEndsCancelled) {
  const std::string id = jobs_.submit(parameters()).id;
  const Lease lease = claimed(jobs_);
  jobs_.cancel(id);
  jobs_.put_back(lease);
  EXPECT_EQ(jobs_.get(id).state, JobState::kCancelled);
  EXPECT_FALSE(has_work(jobs_));
}

// --- Waiting
// -----------------------------------------------------------------------------------------

TEST_F(JobStoreTest, WaitReturnsAtOnceForAFinishedJob) {
  const std::string id = jobs_.submit(parameters()).id;
  jobs_.cancel(id);
  EXPECT_EQ(jobs_.wait(id, kLong).state, JobState::kCancelled);
}

TEST_F(JobStoreTest, WaitIsOverAfterItsTime) {
  const std::string id = jobs_.submit(parameters()).id;
  EXPECT_EQ(jobs_.wait(id, kNever).state, JobState::kQueued);
  EXPECT_EQ(jobs_.wait(id, milliseconds(5)).state, JobState::kQueued);
}

TEST_F(JobStoreTest, WaitWakesWhenTheJobEnds) {
  const std::string id = jobs_.submit(parameters()).id;
  Job seen;
  std::jthread waiter([&] { seen = jobs_.wait(id, kLong); });
  const Lease lease = claimed(jobs_);
  jobs_.report(lease, Stage::kSmooth, 0.5, {});
  jobs_.finish(lease, mesh_of({"k"}), {});
  waiter.join();
  EXPECT_EQ(seen.state, JobState::kSucceeded);
}

TEST_F(JobStoreTest, WaitersOfSeveralJobsGetTheirOwn) {
  const std::string one = jobs_.submit(parameters()).id;
  const std::string other = jobs_.submit(parameters()).id;
  Job seen;
  std::jthread waiter([&] { seen = jobs_.wait(other, kLong); });
  jobs_.cancel(one);
  jobs_.cancel(other);
  waiter.join();
  EXPECT_EQ(seen.id, other);
  EXPECT_EQ(seen.state, JobState::kCancelled);
}

TEST_F(JobStoreTest, CloseWakesThoseWhoWait) {
  const std::string id = jobs_.submit(parameters()).id;
  Job seen;
  std::jthread waiter([&] { seen = jobs_.wait(id, kLong); });
  jobs_.close();
  waiter.join();
  EXPECT_EQ(seen.state, JobState::kQueued);
}

TEST_F(JobStoreTest, NothingIsAcceptedOnceItIsClosed) {
  EXPECT_FALSE(jobs_.is_full());
  jobs_.close();
  EXPECT_TRUE(jobs_.is_full());
  EXPECT_EQ(code_thrown_by([&] { jobs_.submit(parameters()); }), ErrorCode::kUnavailable);
}

// --- Limits
// ------------------------------------------------------------------------------------------

TEST_F(JobStoreTest, AFullQueueAcceptsNothing) {
  JobStore jobs(blobs_, {.max_queued = 3, .max_finished = 10});
  for (int n = 0; n < 3; ++n) jobs.submit(parameters(Priority{n}));
  EXPECT_TRUE(jobs.is_full());
  EXPECT_EQ(code_thrown_by([&] { jobs.submit(parameters(Priority::kStat)); }),
            ErrorCode::kUnavailable);
  EXPECT_EQ(jobs.list({}, "", 10).size(), 3U);
  claimed(jobs);
  EXPECT_FALSE(jobs.is_full());
  jobs.submit(parameters());
  EXPECT_TRUE(jobs.is_full());
}

TEST_F(JobStoreTest, CancellingMakesRoomInTheQueue) {
  JobStore jobs(blobs_, {.max_queued = 1, .max_finished = 10});
  jobs.cancel(jobs.submit(parameters()).id);
  EXPECT_FALSE(jobs.is_full());
}

TEST_F(JobStoreTest, TheOldestFinishedJobsAreForgotten) {
  JobStore jobs(blobs_, {.max_queued = 10, .max_finished = 2});
  std::vector<std::string> ids;
  for (int n = 0; n < 4; ++n) ids.push_back(jobs.submit(parameters()).id);
  const Lease oldest = claimed(jobs);  // is the oldest, but finishes last
  for (int n = 1; n < 4; ++n) jobs.finish(claimed(jobs), failure(), {});
  jobs.finish(oldest, failure(), {});
  EXPECT_EQ(jobs.get(ids[0]).state, JobState::kFailed);
  EXPECT_EQ(code_thrown_by([&] { jobs.get(ids[1]); }), ErrorCode::kNotFound);
  EXPECT_EQ(code_thrown_by([&] { jobs.get(ids[2]); }), ErrorCode::kNotFound);
  EXPECT_EQ(jobs.get(ids[3]).state, JobState::kFailed);
}

TEST_F(JobStoreTest, ForgettingErasesOnlyWhatNoOtherJobNames) {
  JobStore jobs(blobs_, {.max_queued = 10, .max_finished = 2});
  const std::string own = blob("of the first only");
  const std::string shared = blob("of the first and the second");
  const std::string last = blob("of the third");
  for (int n = 0; n < 4; ++n) jobs.submit(parameters());
  jobs.finish(claimed(jobs), mesh_of({own, shared}), {});
  jobs.finish(claimed(jobs), mesh_of({shared}), {});
  EXPECT_TRUE(has_blob(own));
  jobs.finish(claimed(jobs), mesh_of({last}), {});
  EXPECT_FALSE(has_blob(own));
  EXPECT_TRUE(has_blob(shared));
  jobs.finish(claimed(jobs), failure(), {});
  EXPECT_FALSE(has_blob(shared));
  EXPECT_TRUE(has_blob(last));
}

// A worker has stored its mesh and is about to finish; an older job with the same mesh goes.
TEST_F(JobStoreTest, ForgettingKeepsAMeshThatARunningJobIsAboutToName) {
  JobStore jobs(blobs_, {.max_queued = 10, .max_finished = 1});
  for (int n = 0; n < 3; ++n) jobs.submit(parameters());
  jobs.finish(claimed(jobs), mesh_of({blob("the same mesh")}), {});
  const Lease other = claimed(jobs);
  const Lease running = claimed(jobs);
  const std::string key = blob("the same mesh");
  jobs.finish(other, failure(), {});
  ASSERT_TRUE(jobs.finish(running, mesh_of({key}), {}));
  EXPECT_TRUE(has_blob(key));
}

TEST_F(JobStoreTest, AVolumeIsNeededWhileAJobWaitsOrRuns) {
  EXPECT_FALSE(jobs_.needs_volume("some volume"));
  jobs_.submit(parameters());
  EXPECT_TRUE(jobs_.needs_volume("some volume"));
  EXPECT_FALSE(jobs_.needs_volume("another"));
  const Lease lease = claimed(jobs_);
  EXPECT_TRUE(jobs_.needs_volume("some volume"));
  jobs_.finish(lease, mesh_of({"k"}), {});
  EXPECT_FALSE(jobs_.needs_volume("some volume"));
}

// --- Listing
// -----------------------------------------------------------------------------------------

TEST_F(JobStoreTest, ListsTheNewestFirst) {
  std::vector<std::string> ids;
  for (int n = 0; n < 50; ++n) ids.push_back(jobs_.submit(parameters()).id);
  EXPECT_EQ(ids_of(jobs_.list({}, "", 100)), std::vector<std::string>(ids.rbegin(), ids.rend()));
}

TEST_F(JobStoreTest, PagesHoldEveryJobOnce) {
  std::vector<std::string> expected;
  for (int n = 0; n < 25; ++n) jobs_.submit(parameters());
  expected = ids_of(jobs_.list({}, "", 100));
  std::vector<std::string> paged;
  for (std::string after; paged.size() < expected.size();) {
    const std::vector<std::string> page = ids_of(jobs_.list({}, after, 10));
    ASSERT_THAT(page, testing::Not(IsEmpty()));
    paged.insert(paged.end(), page.begin(), page.end());
    after = page.back();
  }
  EXPECT_EQ(paged, expected);
  EXPECT_THAT(jobs_.list({}, expected.back(), 10), IsEmpty());
}

TEST_F(JobStoreTest, ListsByState) {
  const std::string cancelled = jobs_.submit(parameters()).id;
  jobs_.cancel(cancelled);
  const std::string running = jobs_.submit(parameters()).id;
  claimed(jobs_);
  const std::string queued = jobs_.submit(parameters()).id;
  EXPECT_THAT(ids_of(jobs_.list(JobState::kCancelled, "", 10)), ElementsAre(cancelled));
  EXPECT_THAT(ids_of(jobs_.list(JobState::kRunning, "", 10)), ElementsAre(running));
  EXPECT_THAT(ids_of(jobs_.list(JobState::kQueued, "", 10)), ElementsAre(queued));
  EXPECT_THAT(jobs_.list(JobState::kFailed, "", 10), IsEmpty());
}

TEST_F(JobStoreTest, ACursorNeedNotNameAJob) {
  const std::string id = jobs_.submit(parameters()).id;
  EXPECT_THAT(jobs_.list({}, "0", 10), IsEmpty());
  EXPECT_THAT(ids_of(jobs_.list({}, "~", 10)), ElementsAre(id));
}

}  // namespace
}  // namespace isomesh::store
