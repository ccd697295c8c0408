// Tests of jobs on every engine, from submission to their end.
#include <chrono>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>

#include "tests/support/errors.h"
#include "tests/support/stores.h"
#include "tests/unit/store/engine.h"

namespace isomesh::store {
namespace {

using std::chrono::milliseconds;
using test::code_thrown_by;
using testing::ElementsAre;
using testing::IsEmpty;

class JobConformance : public test::EngineTest {};

INSTANTIATE_TEST_SUITE_P(Engines, JobConformance, testing::ValuesIn(test::all_engines()),
                         test::name_of);

// --- Submitting and claiming

TEST_P(JobConformance, ASubmittedJobIsQueued) {
  const Job job = submit(parameters(Priority::kBulk));
  EXPECT_EQ(job.state, JobState::kQueued);
  EXPECT_EQ(job.stage, Stage::kQueue);
  EXPECT_EQ(job.progress, 0);
  EXPECT_EQ(job.parameters, parameters(Priority::kBulk));
  EXPECT_FALSE(job.created.empty());
  EXPECT_FALSE(job.started || job.finished || job.mesh || job.error || job.reused);
  EXPECT_EQ(job.timing, Timing{});
  EXPECT_EQ(jobs().get("", job.id), job);
}

TEST_P(JobConformance, AnUnknownJobIsNotFound) {
  EXPECT_EQ(code_thrown_by([&] { jobs().get("", "x"); }), ErrorCode::kNotFound);
  EXPECT_EQ(code_thrown_by([&] { jobs().cancel("", "x"); }), ErrorCode::kNotFound);
}

TEST_P(JobConformance, AnUnknownVolumeIsNotFoundAndNamed) {
  JobParameters unknown = parameters();
  unknown.volume = "gone";
  const Error error = test::error_of([&] { submit(unknown); });
  EXPECT_EQ(error.code(), ErrorCode::kNotFound);
  EXPECT_EQ(error.fields().at(0).field, "volume");
  EXPECT_THAT(jobs().list("", {}, "", 10), IsEmpty());
}

TEST_P(JobConformance, ClaimsByPriorityThenAge) {
  std::vector<std::string> expected;
  const std::string bulk = submit(unlike(Priority::kBulk)).id;
  for (int n = 0; n < 20; ++n) expected.push_back(submit().id);
  const std::string other_bulk = submit(unlike(Priority::kBulk)).id;
  expected.insert(expected.begin(), submit(unlike(Priority::kStat)).id);
  expected.insert(expected.begin() + 1, submit(unlike(Priority::kStat)).id);
  expected.insert(expected.end(), {bulk, other_bulk});
  std::vector<std::string> order;
  while (can_claim()) order.push_back(claimed().id);
  EXPECT_EQ(order, expected);
  EXPECT_FALSE(jobs().claim("worker", kLongLease));
}

TEST_P(JobConformance, AClaimedJobRuns) {
  const std::string id = submit(parameters()).id;
  const Lease lease = claimed();
  EXPECT_EQ(lease.id, id);
  EXPECT_EQ(lease.attempt, 1);
  EXPECT_EQ(lease.owner, "");
  EXPECT_EQ(lease.parameters, parameters());
  const Job job = jobs().get("", id);
  EXPECT_EQ(job.state, JobState::kRunning);
  EXPECT_TRUE(job.started);
  EXPECT_FALSE(job.finished);
}

TEST_P(JobConformance, WaitingForWorkEndsWithAJob) {
  bool has_work = false;
  std::jthread worker([&] { has_work = jobs().wait_for_work({}, kLong); });
  submit();
  worker.join();
  EXPECT_TRUE(has_work);
}

TEST_P(JobConformance, WaitingForWorkEndsWhenItIsStopped) {
  std::stop_source stop;
  std::jthread worker([&] { jobs().wait_for_work(stop.get_token(), kLong); });
  stop.request_stop();
  worker.join();
  EXPECT_FALSE(jobs().wait_for_work({}, milliseconds(5)));
}

// --- Running

const Progress kSomeProgress = {Stage::kSmooth, 0.4, {.load = 1, .extract = 2}};

void expect_some_progress(const Job& job, double queued) {
  EXPECT_EQ(job.stage, kSomeProgress.stage);
  EXPECT_EQ(job.progress, kSomeProgress.share);
  EXPECT_EQ(job.timing.load, kSomeProgress.timing.load);
  EXPECT_EQ(job.timing.extract, kSomeProgress.timing.extract);
  EXPECT_EQ(job.timing.queue, queued);
}

TEST_P(JobConformance, ProgressIsSeen) {
  const std::string id = submit().id;
  const Lease lease = claimed();
  const double queued = jobs().get("", id).timing.queue;
  EXPECT_EQ(jobs().renew(lease, kSomeProgress, kLongLease), Standing::kOk);
  const Job job = jobs().get("", id);
  expect_some_progress(job, queued);
}

TEST_P(JobConformance, AMeshEndsItSucceeded) {
  const std::string id = submit().id;
  Outcome outcome = some_mesh();
  outcome.timing = {.load = 1, .encode = 4};
  EXPECT_TRUE(jobs().finish(claimed(), outcome));
  const Job job = jobs().get("", id);
  EXPECT_EQ(job.state, JobState::kSucceeded);
  EXPECT_EQ(job.stage, Stage::kDone);
  EXPECT_EQ(job.progress, 1);
  EXPECT_EQ(job.mesh->triangles, 12U);
  EXPECT_EQ(job.mesh->files.at(MeshFormat::kDrc).href, "/v1/jobs/" + id + "/mesh.drc");
  EXPECT_TRUE(job.started && job.finished);
  EXPECT_EQ(job.timing.encode, 4);
  EXPECT_GE(job.timing.total, job.timing.queue);
  EXPECT_GT(job.timing.total, 0);
}

TEST_P(JobConformance, AJobWithoutAMeshKeepsItsLastProgress) {
  const auto end_by = [&](auto&& end) {
    const std::string id = submit().id;
    const Lease lease = claimed();
    const double queued = jobs().get("", id).timing.queue;
    jobs().renew(lease, kSomeProgress, kLongLease);
    end(lease);
    const Job job = jobs().get("", id);
    expect_some_progress(job, queued);
    EXPECT_GE(job.timing.total, queued);
    EXPECT_FALSE(can_claim());
    return job.state;
  };
  EXPECT_EQ(end_by([&](const Lease& lease) { jobs().finish(lease, failure()); }),
            JobState::kFailed);
  EXPECT_EQ(end_by([&](const Lease& lease) { jobs().finish(lease, {}); }), JobState::kCancelled);
  EXPECT_EQ(end_by([&](const Lease& lease) {
              jobs().cancel("", lease.id);
              jobs().finish(lease, failure());
            }),
            JobState::kCancelled);
  // Nobody asks for a stop again after the job was put back.
  EXPECT_EQ(end_by([&](const Lease& lease) {
              jobs().cancel("", lease.id);
              EXPECT_TRUE(jobs().put_back(lease, milliseconds(0)));
            }),
            JobState::kCancelled);
}

TEST_P(JobConformance, TheFilesOfLabelsAndWallsBelongToTheirMesh) {
  for (const auto list : {&MeshSummary::label_list, &MeshSummary::wall_list}) {
    Outcome outcome = some_mesh();
    *outcome.mesh.*list = {9, put_blob("the pages")};
    const std::string key = (*outcome.mesh.*list)->sha256;
    const JobParameters parameters = unlike();
    const std::string id = submit(parameters).id;
    EXPECT_TRUE(jobs().finish(claimed(), outcome));
    EXPECT_EQ(*jobs().get("", id).mesh.*list, *outcome.mesh.*list);
    EXPECT_TRUE(volumes().names(key));
    EXPECT_TRUE(submit(parameters).reused);
    blobs().erase(key);
    const auto made_again = submit(parameters);
    EXPECT_FALSE(made_again.reused);
    jobs().cancel("", made_again.id);
  }
}

TEST_P(JobConformance, AnErrorEndsItFailed) {
  const std::string id = submit().id;
  EXPECT_TRUE(jobs().finish(claimed(), failure()));
  const Job job = jobs().get("", id);
  EXPECT_EQ(job.state, JobState::kFailed);
  EXPECT_EQ(job.error->detail, "too large");
  EXPECT_FALSE(job.mesh);
}

TEST_P(JobConformance, ADamagedRecordHidesAndBlocksNoOther) {
  const std::string damaged = submit().id;
  const std::string next = submit().id;
  damage("jobs", damaged);
  const auto listed = jobs().list("", {}, "", 1);
  ASSERT_EQ(listed.size(), 1U);
  EXPECT_EQ(listed[0].id, next);
  EXPECT_TRUE(jobs().list("", {}, next, 1).empty());
  EXPECT_EQ(test::code_thrown_by([&] { jobs().get("", damaged); }), ErrorCode::kInternal);
  EXPECT_EQ(claimed().id, next);
  const Job failed = jobs().get("", damaged);
  EXPECT_EQ(failed.state, JobState::kFailed);
  EXPECT_THAT(failed.error.value().detail, testing::HasSubstr("damaged"));
  EXPECT_EQ(failed.parameters.volume, kVolume);
  EXPECT_FALSE(can_claim());
}

TEST_P(JobConformance, ADamagedPriorityOrStateIsOneOfThoseThatThereAre) {
  const std::string id = submit().id;
  const std::string next = submit().id;
  database().run(Change::kRepeatable, "UPDATE jobs SET priority = 77 WHERE id = ?1", id);
  EXPECT_EQ(jobs().depth("").all_queued(), 2U);
  EXPECT_EQ(jobs().list("", {}, "", 9).size(), 2U);
  database().run(Change::kRepeatable, "UPDATE jobs SET state = 77 WHERE id = ?1", id);
  damage("jobs", id);
  EXPECT_EQ(jobs().depth("").all_queued(), 1U);
  EXPECT_EQ(jobs().cancel("", id).state, JobState::kCancelled);
  EXPECT_EQ(claimed().id, next);
}

TEST_P(JobConformance, ADamagedRecordIsCancelledAndFreesItsVolume) {
  const std::string queued = submit().id;
  damage("jobs", queued);
  EXPECT_EQ(jobs().cancel("", queued).state, JobState::kCancelled);
  EXPECT_EQ(jobs().get("", queued).state, JobState::kCancelled);
  const JobParameters parameters = unlike();
  const std::string ended = submit(parameters).id;
  jobs().finish(claimed(), some_mesh());
  damage("jobs", ended);
  EXPECT_FALSE(submit(parameters).reused);
  EXPECT_EQ(jobs().cancel("", ended).state, JobState::kCancelled);
  EXPECT_EQ(jobs().get("", ended).state, JobState::kCancelled);
  jobs().finish(claimed(), some_mesh());
  EXPECT_NO_THROW(volumes().erase("", kVolume));
}

TEST_P(JobConformance, AnEndedJobIsErasedOnce) {
  JobParameters wanted = unlike();
  wanted.callback = Callback{"http://127.0.0.1/"};
  const std::string id = submit(wanted).id;
  EXPECT_FALSE(jobs().erase("", id));
  const Lease lease = claimed();
  EXPECT_FALSE(jobs().erase("", id));
  const std::string blob = put_blob("some mesh");
  jobs().finish(lease, some_mesh());
  const std::string reused = submit(wanted).id;
  std::vector<std::string> going;
  const auto note = [&](std::span<const std::string> keys) {
    going.assign(keys.begin(), keys.end());
  };
  EXPECT_EQ(code_thrown_by([&] { jobs().erase("other", id, note); }), ErrorCode::kNotFound);
  EXPECT_EQ(jobs().get("", id).state, JobState::kSucceeded);
  EXPECT_TRUE(jobs().erase("", id, note));
  EXPECT_THAT(going, ElementsAre(blob));
  EXPECT_TRUE(volumes().names(blob));  // by the equal job
  EXPECT_EQ(code_thrown_by([&] { jobs().get("", id); }), ErrorCode::kNotFound);
  EXPECT_EQ(code_thrown_by([&] { jobs().erase("", id); }), ErrorCode::kNotFound);
  const auto events = test::events_of(jobs(), "", id, 1);
  ASSERT_EQ(events.size(), 1U) << "somebody may wait for its end";
  EXPECT_EQ(events[0].kind, EventKind::kDone);
  EXPECT_EQ(outbox().count(), 1U);
  damage("jobs", reused);
  EXPECT_TRUE(jobs().erase(std::nullopt, reused));
  EXPECT_FALSE(volumes().names(blob));
  EXPECT_EQ(outbox().count(), 0U);
  EXPECT_FALSE(submit(wanted).reused);
}

TEST_P(JobConformance, ARecordThatIsDamagedWhileItRunsDoesNotRunAgain) {
  const std::string id = submit().id;
  claimed();
  damage("jobs", id);
  restart();
  EXPECT_FALSE(jobs().claim("worker", kLongLease));
  EXPECT_EQ(jobs().get("", id).state, JobState::kFailed);
}

TEST_P(JobConformance, AnEqualJobWithADamagedRecordHoldsUpNoResult) {
  const JobParameters parameters = unlike();
  const std::string id = submit(parameters).id;
  const Lease lease = claimed();
  const std::string equal = submit(parameters).id;
  damage("jobs", equal);
  EXPECT_TRUE(jobs().finish(lease, some_mesh()));
  EXPECT_EQ(jobs().get("", id).state, JobState::kSucceeded);
  EXPECT_TRUE(is_final(jobs().get("", equal).state));
  EXPECT_FALSE(jobs().get("", equal).mesh);
}

TEST_P(JobConformance, AFinishedJobTakesNoLateNews) {
  const std::string id = submit().id;
  const Lease lease = claimed();
  jobs().finish(lease, some_mesh());
  const Job ended = jobs().get("", id);
  EXPECT_EQ(jobs().renew(lease, {Stage::kLoad, 0.1, {}}, kLongLease), Standing::kLost);
  EXPECT_FALSE(jobs().finish(lease, failure()));
  EXPECT_FALSE(jobs().put_back(lease, milliseconds(0)));
  EXPECT_EQ(jobs().get("", id), ended);
  EXPECT_FALSE(can_claim());
}

TEST_P(JobConformance, AJobThatIsPutBackIsAsIfItHadNotRun) {
  const Job job = submit();
  const std::string next = submit().id;
  const Lease lease = claimed();
  jobs().renew(lease, {Stage::kSmooth, 0.5, {.load = 3}}, kLongLease);
  EXPECT_TRUE(jobs().put_back(lease, milliseconds(0)));
  EXPECT_EQ(jobs().get("", job.id), job);
  const Lease again = claimed();
  EXPECT_EQ(again.id, job.id);
  EXPECT_EQ(again.attempt, 1);
  EXPECT_GT(again.fence, lease.fence);
  EXPECT_EQ(claimed().id, next);
}

TEST_P(JobConformance, AJobThatIsPutBackSaysWhatItWaitsForUntilItRuns) {
  const std::string id = submit().id;
  jobs().put_back(claimed(), milliseconds(0), WaitingFor::kDisk);
  EXPECT_EQ(jobs().get("", id).waiting_for, WaitingFor::kDisk);
  EXPECT_EQ(jobs().depth(std::nullopt).waiting_for_disk, 1U);
  restart();
  EXPECT_EQ(jobs().get("", id).waiting_for, WaitingFor::kDisk);
  const Lease lease = claimed();
  EXPECT_EQ(jobs().get("", id).waiting_for, std::nullopt);
  EXPECT_EQ(jobs().depth(std::nullopt).waiting_for_disk, 0U);
  jobs().put_back(lease, milliseconds(0), WaitingFor::kDisk);
  EXPECT_EQ(jobs().cancel("", id).waiting_for, std::nullopt);
  EXPECT_EQ(jobs().depth(std::nullopt).waiting_for_disk, 0U);
}

TEST_P(JobConformance, AJobThatIsPutBackForLaterLetsOthersGoFirst) {
  submit();
  const std::string next = submit().id;
  jobs().put_back(claimed(), std::chrono::hours(1));
  const Lease lease = claimed();
  EXPECT_EQ(lease.id, next);
  EXPECT_FALSE(jobs().claim("worker", kLongLease));
  jobs().put_back(lease, milliseconds(50));
  EXPECT_TRUE(jobs().wait_for_work({}, kLong));
  EXPECT_EQ(claimed().id, next);
}

// --- Cancelling

TEST_P(JobConformance, ACancelledQueuedJobNeverRuns) {
  const std::string id = submit().id;
  const std::string next = submit().id;
  EXPECT_EQ(jobs().cancel("", id).state, JobState::kCancelled);
  EXPECT_TRUE(jobs().get("", id).finished);
  EXPECT_EQ(claimed().id, next);
  EXPECT_FALSE(can_claim());
}

TEST_P(JobConformance, ACancelledRunningJobIsAskedToStop) {
  const std::string id = submit().id;
  const Lease lease = claimed();
  EXPECT_EQ(jobs().cancel("", id).state, JobState::kRunning);
  EXPECT_EQ(jobs().renew(lease, {}, kLongLease), Standing::kCancel);
  EXPECT_TRUE(jobs().finish(lease, {}));
  EXPECT_EQ(jobs().get("", id).state, JobState::kCancelled);
}

TEST_P(JobConformance, AJobThatWasAskedToStopEndsCancelledWhateverItsOutcome) {
  for (const Outcome& outcome : {some_mesh(), failure(), failure(true)}) {
    const std::string id = submit().id;
    const Lease lease = claimed();
    jobs().cancel("", id);
    EXPECT_TRUE(jobs().finish(lease, outcome));
    const Job job = jobs().get("", id);
    EXPECT_EQ(job.state, JobState::kCancelled);
    EXPECT_FALSE(job.mesh || job.error);
  }
}

TEST_P(JobConformance, ACancelledJobsMeshIsNamedByNothing) {
  const std::string key = put_blob("mesh");
  const Lease lease = (submit(), claimed());
  jobs().cancel("", lease.id);
  jobs().finish(lease, mesh_of({{key, 4}}));
  EXPECT_FALSE(volumes().names(key));
}

TEST_P(JobConformance, AFinishedJobStaysAsItIs) {
  const std::string id = submit().id;
  jobs().finish(claimed(), some_mesh());
  const Job ended = jobs().get("", id);
  EXPECT_EQ(jobs().cancel("", id), ended);
  EXPECT_EQ(jobs().get("", id), ended);
}

// --- Waiting

TEST_P(JobConformance, CloseWakesThoseWhoWait) {
  const auto began = std::chrono::steady_clock::now();
  std::jthread reader([&] { EXPECT_THAT(jobs().events("", "x", 0, kLong), IsEmpty()); });
  jobs().close();
  reader.join();
  EXPECT_LT(std::chrono::steady_clock::now() - began, kLong);
}

TEST_P(JobConformance, NothingIsAcceptedOnceItIsClosed) {
  EXPECT_FALSE(jobs().is_full());
  jobs().close();
  EXPECT_TRUE(jobs().is_full());
  EXPECT_EQ(jobs().submit({"", parameters(), "", ""}).kind, Submission::Kind::kBusy);
  EXPECT_EQ(code_thrown_by([&] { submit(); }), ErrorCode::kUnavailable);
}

// --- Limits

TEST_P(JobConformance, OneOwnerDoesNotFillTheQueue) {
  make({.max_queued = 8});
  add_volume("greedy", kVolume);
  add_volume("third", kVolume);
  const auto submit_as = [&](const std::string& owner, Priority priority) {
    return jobs().submit({owner, unlike(priority), "", ""}).kind;
  };
  for (int n = 0; n < 4; ++n) submit_as("greedy", Priority::kRoutine);
  const Submission refused = jobs().submit({"greedy", unlike(Priority::kBulk), "", ""});
  EXPECT_EQ(code_thrown_by([&] { job_of(refused); }), ErrorCode::kTooManyRequests);
  EXPECT_EQ(submit_as("other", Priority::kRoutine), Submission::Kind::kNew);
  EXPECT_EQ(submit_as("third", Priority::kRoutine), Submission::Kind::kNew);
}

TEST_P(JobConformance, OneOwnersUrgentJobsAreFew) {
  make({.max_queued = 64});
  add_volume("urgent", kVolume);
  const auto submit_as = [&](const std::string& owner, Priority priority) {
    return jobs().submit({owner, unlike(priority), "", ""}).kind;
  };
  for (int n = 0; n < 4; ++n) submit_as("urgent", Priority::kStat);
  EXPECT_EQ(submit_as("urgent", Priority::kStat), Submission::Kind::kOwnersShare);
  EXPECT_EQ(submit_as("urgent", Priority::kRoutine), Submission::Kind::kNew);
  EXPECT_EQ(submit_as("other", Priority::kStat), Submission::Kind::kNew);
}

// An eighth would be one place, and the first owner's alone.
TEST_P(JobConformance, UrgentJobsOfTwoOwnersFitIntoASmallQueue) {
  make({.max_queued = 10});
  for (const char* owner : {"urgent", "third"}) add_volume(owner, kVolume);
  const auto submit_as = [&](const std::string& owner) {
    return jobs().submit({owner, unlike(Priority::kStat), "", ""}).kind;
  };
  EXPECT_EQ(submit_as("urgent"), Submission::Kind::kNew);
  EXPECT_EQ(submit_as("urgent"), Submission::Kind::kOwnersShare);
  EXPECT_EQ(submit_as("other"), Submission::Kind::kNew);
  EXPECT_EQ(submit_as("third"), Submission::Kind::kBusy) << "none of its jobs are waiting";
}

TEST_P(JobConformance, AFullQueueAcceptsNothing) {
  make({.max_queued = 3});
  for (int n = 0; n < 3; ++n) submit(unlike(Priority{n}));
  EXPECT_TRUE(jobs().is_full());
  const Submission refused = jobs().submit({"", unlike(Priority::kStat), "key", "digest"});
  EXPECT_EQ(refused.kind, Submission::Kind::kBusy);
  EXPECT_EQ(jobs().list("", {}, "", 10).size(), 3U);
  claimed();
  EXPECT_FALSE(jobs().is_full());
  EXPECT_EQ(jobs().submit({"", unlike(), "key", "digest"}).kind, Submission::Kind::kNew);
  EXPECT_TRUE(jobs().is_full());
}

TEST_P(JobConformance, TheDepthIsCountedByPriority) {
  submit();
  claimed();
  for (const Priority priority : {Priority::kStat, Priority::kBulk, Priority::kBulk}) {
    submit(unlike(priority));
  }
  const QueueDepth depth = jobs().depth(std::nullopt);
  EXPECT_THAT(depth.queued, ElementsAre(1U, 0U, 2U));
  EXPECT_EQ(depth.running, 1U);
  EXPECT_EQ(depth.all_queued(), 3U);
  EXPECT_EQ(jobs().depth("").all_queued(), 3U);
  EXPECT_EQ(jobs().depth("other").all_queued() + jobs().depth("other").running, 0U);
}

}  // namespace
}  // namespace isomesh::store
