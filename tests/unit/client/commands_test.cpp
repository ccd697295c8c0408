#include "client/cli/commands.h"

#include <algorithm>
#include <atomic>
#include <functional>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "tests/unit/client/support.h"

namespace isomesh::cli {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::StartsWith;

struct Outcome {
  int status = 0;
  std::string out;
  std::string err;
};

Outcome outcome_of(const Options& options, const std::stop_token& stop = {}) {
  testing::internal::CaptureStdout();
  testing::internal::CaptureStderr();
  const int status = run(options, stop);
  return {.status = status,
          .out = testing::internal::GetCapturedStdout(),
          .err = testing::internal::GetCapturedStderr()};
}

// A server with one volume "abc" and one job "7", which is `job_`.
class Commands : public testing::Test {
 protected:
  Commands() {
    server_.http.Post("/v1/volumes", [](const auto&, auto& response, const auto& read) {
      read([](const char*, std::size_t) { return true; });
      Volume volume;
      volume.id = "abc";
      response.set_content(to_json(volume), "application/json");
    });
    server_.http.Post("/v1/jobs", [this](const httplib::Request& request, auto& response) {
      asked_ = parse_job_parameters(request.body);
      response.set_content(to_json(job_), "application/json");
    });
    server_.http.Get("/v1/jobs/7", [this](const auto&, auto& response) {
      if (at_a_look_) at_a_look_();
      response.set_content(to_json(job_), "application/json");
    });
    server_.http.Get("/v1/jobs/7/mesh.drc", [](const auto&, auto& response) {
      response.set_content("mesh", "application/octet-stream");
    });
    server_.http.Delete("/v1/jobs/7", [this](const auto&, auto& response) {
      ++cancelled_;
      response.set_content(to_json(job_), "application/json");
    });
    test::write_file(folder_ / "head.nii", "volume");
    options_.server = server_.start();
    options_.command = Command::kMesh;
    options_.files = {folder_ / "head.nii"};
    options_.outputs = {{.path = folder_ / "head.drc", .format = MeshFormat::kDrc}};
  }

  Job job_ = test::finished_job("7", "mesh");
  JobParameters asked_;
  std::atomic<int> cancelled_ = 0;
  std::function<void()> at_a_look_;  // runs when the job is asked for
  test::TemporaryFolder folder_;
  test::FakeServer server_;
  Options options_;
};

TEST_F(Commands, MeshWritesTheMeshAndTellsWhatItTook) {
  const Outcome outcome = outcome_of(options_);
  EXPECT_EQ(outcome.status, kDone);
  EXPECT_EQ(outcome.err, "");
  EXPECT_THAT(outcome.out, StartsWith((folder_ / "head.drc").string()));
  EXPECT_THAT(outcome.out, HasSubstr("\n  extract"));
  EXPECT_THAT(outcome.out, HasSubstr("\n  triangles"));
  EXPECT_EQ(test::read_file(folder_ / "head.drc"), "mesh");
  EXPECT_EQ(asked_.volume, "abc");
  EXPECT_THAT(asked_.formats, ElementsAre(MeshFormat::kDrc));
}

TEST_F(Commands, MeshPrintsOneJsonObjectForScripts) {
  options_.json = true;
  const Outcome outcome = outcome_of(options_);
  EXPECT_EQ(outcome.status, kDone);
  EXPECT_EQ(job_from_json(outcome.out), job_);
  EXPECT_THAT(outcome.out, HasSubstr("\"outputs\":[\"" + (folder_ / "head.drc").string() + "\"]"));
}

TEST_F(Commands, AJobThatFailedGivesTheServersReason) {
  job_.state = JobState::kFailed;
  job_.mesh.reset();
  job_.error = to_problem(Error(ErrorCode::kTooLarge, "the mesh has too many triangles"), "");
  const Outcome outcome = outcome_of(options_);
  EXPECT_EQ(outcome.status, kRefused);
  EXPECT_EQ(outcome.err, "isomesh: the mesh has too many triangles\n");
  EXPECT_THAT(test::files_below(folder_.path()), ElementsAre("head.nii"));
}

TEST_F(Commands, AnInterruptCancelsTheJobThatMeshWaitsFor) {
  job_.state = JobState::kRunning;
  job_.mesh.reset();
  std::stop_source stop;
  at_a_look_ = [&] { stop.request_stop(); };
  const Outcome outcome = outcome_of(options_, stop.get_token());
  EXPECT_EQ(outcome.status, kRefused);
  EXPECT_EQ(cancelled_, 1);
  EXPECT_THAT(outcome.err, HasSubstr("the job 7 was cancelled"));
}

TEST_F(Commands, ARefusalIsStatusOne) {
  options_.command = Command::kInfo;
  options_.id = "missing";
  const Outcome outcome = outcome_of(options_);
  EXPECT_EQ(outcome.status, kRefused);
  EXPECT_THAT(outcome.err, HasSubstr("404"));
}

TEST_F(Commands, AServerThatIsNotThereIsStatusThree) {
  options_.server = test::unused_url();
  const Outcome outcome = outcome_of(options_);
  EXPECT_EQ(outcome.status, kServerUnreachable);
  EXPECT_THAT(outcome.err, StartsWith("isomesh: no response from http://"));
}

TEST_F(Commands, AServerThatGoesAwayLeavesAJobToComeBackTo) {
  job_.state = JobState::kRunning;
  job_.mesh.reset();
  at_a_look_ = [&] { server_.http.stop(); };
  const Outcome outcome = outcome_of(options_);
  EXPECT_EQ(outcome.status, kServerUnreachable);
  EXPECT_THAT(outcome.err, HasSubstr(options_.server));
  EXPECT_THAT(outcome.err, HasSubstr(" wait 7\n"));
  EXPECT_THAT(outcome.err, HasSubstr(" fetch 7 -o OUT"));
}

TEST_F(Commands, QuietSaysNothing) {
  options_.quiet = true;
  const Outcome outcome = outcome_of(options_);
  EXPECT_EQ(outcome.status, kDone);
  EXPECT_EQ(outcome.out + outcome.err, "");
  EXPECT_EQ(test::read_file(folder_ / "head.drc"), "mesh");
}

TEST_F(Commands, StandardOutputTakesTheMeshAlone) {
  options_.outputs = {{.path = "-", .format = MeshFormat::kDrc}};
  const Outcome outcome = outcome_of(options_);
  EXPECT_EQ(outcome.status, kDone);
  EXPECT_EQ(outcome.out, "mesh");
}

TEST_F(Commands, SeveralInputsHaveAMeshEach) {
  test::write_file(folder_ / "knee.nii", "another");
  options_.files.emplace_back(folder_ / "knee.nii");
  options_.outputs = {{.path = folder_ / "{name}.drc", .format = MeshFormat::kDrc}};
  options_.jobs = 2;
  const Outcome outcome = outcome_of(options_);
  EXPECT_EQ(outcome.status, kDone) << outcome.err;
  EXPECT_EQ(test::read_file(folder_ / "head.drc"), "mesh");
  EXPECT_EQ(test::read_file(folder_ / "knee.drc"), "mesh");
  options_.json = true;
  EXPECT_EQ(std::ranges::count(outcome_of(options_).out, '\n'), 2);
}

TEST_F(Commands, AnAddressThatIsNoneIsWrongUsage) {
  options_.server = "ftp://somewhere";
  EXPECT_EQ(outcome_of(options_).status, kWrongUsage);
}

TEST_F(Commands, UploadAndSubmitPrintTheBareIdForTheShell) {
  options_.command = Command::kUpload;
  EXPECT_EQ(outcome_of(options_).out, "abc\n");
  options_.command = Command::kSubmit;
  options_.id = "abc";
  EXPECT_EQ(outcome_of(options_).out, "7\n");
}

TEST_F(Commands, StatusAnswersWhateverTheStateIs) {
  options_.command = Command::kStatus;
  options_.id = "7";
  job_.state = JobState::kCancelled;
  job_.mesh.reset();
  EXPECT_EQ(outcome_of(options_).status, kDone);
  options_.command = Command::kWait;
  const Outcome waited = outcome_of(options_);
  EXPECT_EQ(waited.status, kRefused);
  EXPECT_EQ(waited.err, "isomesh: the job was cancelled\n");
}

}  // namespace
}  // namespace isomesh::cli
