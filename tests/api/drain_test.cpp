// Ending: what runs is finished or put back, and nothing new is accepted.
#include <csignal>
#include <string>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/api/problems.h"
#include "tests/support/shapes.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;

TEST(Drain, AnIdleDaemonEndsAtOnceOnEitherSignal) {
  for (const int signal : {SIGTERM, SIGINT}) {
    Daemon daemon;
    daemon.send_signal(signal);
    EXPECT_EQ(daemon.wait(), 0);
  }
}

// Terminates the daemon and lets its worker go on when it drains and has answered what came before.
void drain(Daemon& daemon, HeldWorker& held) {
  daemon.terminate();
  EXPECT_TRUE(eventually([&] { return daemon.errors().find("draining") != std::string::npos; }));
  // Waits behind what came before.
  EXPECT_EQ(daemon.get("/v1/jobs/0123").status, 404);
  held.let_go();
}

TEST(Drain, LetsARunningJobFinish) {
  Daemon daemon({"--drain-seconds", "100", "--workers", "1"});
  HeldWorker held(daemon);
  const std::string job = submit(daemon, upload(daemon, sphere_upload()), 80).id;
  ASSERT_TRUE(eventually([&] { return daemon.client().job(job).state == JobState::kRunning; }));
  const Connection waiter(daemon.url());
  waiter.send(request("GET", "/v1/jobs/" + job + "?wait=30"));
  drain(daemon, held);
  const Answer answer = waiter.receive();
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(job_from_json(answer.body).state, JobState::kSucceeded);
  EXPECT_EQ(daemon.wait(), 0);
}

// Ctrl-C in a terminal is for the whole process group of the daemon.
TEST(Drain, CtrlCCountsNoAttempt) {
  const TemporaryFolder folder;
  Job job;
  {
    Daemon daemon(folder / "data", "127.0.0.1:0", {"--drain-seconds", "1"}, {"setsid"});
    job = long_job(daemon);
    ASSERT_EQ(::kill(-daemon.pid(), SIGINT), 0);
    EXPECT_EQ(daemon.wait(), 0);
    EXPECT_THAT(daemon.errors(), HasSubstr("they are stopped and put back"));
    EXPECT_THAT(daemon.errors(), testing::Not(HasSubstr("attempt 1 failed")));
  }
  const Daemon next(folder / "data", "127.0.0.1:0");
  EXPECT_TRUE(eventually([&] { return next.client().job(job.id).state == JobState::kRunning; }));
  next.client().cancel(job.id);
}

TEST(Drain, IsNotReadyAndAcceptsNothing) {
  Daemon daemon(std::vector<std::string>{"--drain-seconds", "100"});
  const Job job = long_job(daemon);
  daemon.terminate();
  // A slow check has another reason.
  ASSERT_TRUE(eventually(
      [&] { return daemon.get("/readyz").body.find("shutting down") != std::string::npos; }));
  EXPECT_EQ(daemon.get("/livez").status, 200);
  // Nobody would run it any more.
  EXPECT_TRUE(is_problem(daemon.send("POST", "/v1/jobs", job_body(job.parameters.volume, 50)),
                         ErrorCode::kUnavailable));
  EXPECT_EQ(daemon.get("/v1/jobs/" + job.id).status, 200);
  daemon.client().cancel(job.id);
  EXPECT_EQ(daemon.wait(), 0);
}

TEST(Drain, FinishesTheMeshOfOneRequest) {
  Daemon daemon({"--drain-seconds", "100", "--workers", "1"});
  HeldWorker held(daemon);
  const RawUpload sphere = sphere_upload();
  const Connection client(daemon.url());
  client.send(request("POST", "/v1/mesh?iso=80&" + sphere.query, sphere.bytes));
  ASSERT_TRUE(eventually([&] {
    const auto jobs = daemon.client().jobs().jobs;
    return jobs.size() == 2 && jobs[0].state == JobState::kRunning;
  }));
  drain(daemon, held);
  EXPECT_EQ(client.receive().status, 200);
  EXPECT_EQ(daemon.wait(), 0);
}

// It sends often enough that it is not given up for being slow, and would go on for minutes.
TEST(Drain, ATricklingUploadDoesNotHoldItUp) {
  Daemon daemon(std::vector<std::string>{"--drain-seconds", "0"});
  const Connection connection(daemon.url());
  connection.send(
      "POST /v1/volumes HTTP/1.1\r\nHost: localhost\r\nContent-Length: 900000000\r\n\r\n");
  ASSERT_TRUE(eventually([&] { return !files_below(daemon.data() / "scratch").empty(); }));
  std::jthread trickle([&](const std::stop_token& stop) {
    const std::string some(16'384, 'x');
    while (!stop.stop_requested() && connection.send(some)) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  });
  daemon.terminate();
  EXPECT_TRUE(daemon.ends_within(kLongest));
  trickle.request_stop();
}

}  // namespace
}  // namespace isomesh
