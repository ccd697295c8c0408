// Callbacks of the running daemon to a receiver of the test's.
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/api/problems.h"
#include "tests/support/receiver.h"

namespace isomesh {
namespace {

using namespace test;
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

const std::string kSecret = "thirty-two bytes of secret, at least";

std::vector<std::string> options_for(const TemporaryFolder& folder, const Receiver& receiver) {
  write_file(folder / "secret", kSecret + '\n');
  return {"--callback-allow", receiver.url() + "/hooks",  "--callback-secret-file",
          folder / "secret",  "--callback-retry-seconds", "0.05"};
}

std::string callback_to(const Receiver& receiver) {
  return R"("callback": {"url": ")" + receiver.url() + R"(/hooks/iso?key=1"})";
}

// By the openssl command: nothing of ours has a part in it.
std::string hmac_by_openssl(const TemporaryFolder& folder, const std::string& content) {
  write_file(folder / "content", content);
  const Finished result = run({"sh", "-c",
                               "openssl dgst -sha256 -hmac '" + kSecret + "' -binary " +
                                   std::string(folder / "content") + " | base64"});
  return result.output.substr(0, result.output.find('\n'));
}

class CallbacksTest : public testing::Test {
 protected:
  TemporaryFolder folder_;
};

TEST_F(CallbacksTest, TellTheJobsEndAndAreSigned) {
  const Receiver receiver({503, 204});
  const Daemon daemon(folder_ / "data", "127.0.0.1:0", options_for(folder_, receiver));
  const Job job = finished_job(daemon, callback_to(receiver));
  ASSERT_TRUE(receiver.gets(2));
  const Received received = receiver.received().at(1);
  EXPECT_EQ(received.path, "/hooks/iso");
  EXPECT_EQ(json::parse(received.body), json::parse(daemon.get("/v1/jobs/" + job.id).body));
  EXPECT_EQ(received.headers.at("webhook-id"), job.id);
  const std::string timestamp = received.headers.at("webhook-timestamp");
  EXPECT_EQ(received.headers.at("webhook-signature"),
            "v1," + hmac_by_openssl(folder_, job.id + '.' + timestamp + '.' + received.body));
  EXPECT_EQ(receiver.received().at(0).headers.at("webhook-id"), job.id);
}

TEST_F(CallbacksTest, TellOfJobsThatFailOrAreCancelled) {
  const Receiver receiver;
  auto options = options_for(folder_, receiver);
  options.insert(options.end(), {"--job-memory", "1"});
  const Daemon daemon(folder_ / "data", "127.0.0.1:0", options);
  const Job failed = submit(daemon, upload(daemon, sphere_upload()), 100, callback_to(receiver));
  ASSERT_TRUE(receiver.gets(1));
  EXPECT_EQ(job_from_json(receiver.received().at(0).body).state, JobState::kFailed);
  EXPECT_EQ(job_from_json(receiver.received().at(0).body).id, failed.id);
}

TEST_F(CallbacksTest, OfACancelledJobComesToo) {
  const Receiver receiver;
  auto options = options_for(folder_, receiver);
  options.insert(options.end(), {"--workers", "1"});
  const Daemon daemon(folder_ / "data", "127.0.0.1:0", options);
  const Job busy = long_job(daemon);
  const Volume volume = daemon.client().volume(busy.parameters.volume);
  const Job waiting = submit(daemon, volume, 51, callback_to(receiver));
  daemon.client().cancel(waiting.id);
  ASSERT_TRUE(receiver.gets(1));
  EXPECT_EQ(job_from_json(receiver.received().at(0).body).state, JobState::kCancelled);
}

TEST_F(CallbacksTest, GoOnAfterARestart) {
  Receiver receiver({500});
  const auto options = options_for(folder_, receiver);
  Job job;
  {
    Daemon daemon(folder_ / "data", "127.0.0.1:0", options);
    job = finished_job(daemon, callback_to(receiver));
    ASSERT_TRUE(receiver.gets(1));
    EXPECT_EQ(daemon.stop(), 0);
  }
  receiver.answer_with(204);
  const std::size_t before = receiver.received().size();
  const Daemon daemon(folder_ / "data", "127.0.0.1:0", options);
  ASSERT_TRUE(receiver.gets(before + 1));
  EXPECT_EQ(job_from_json(receiver.received().back().body).id, job.id);
  EXPECT_TRUE(eventually([&] {
    return daemon.get("/metrics").body.find("isomesh_waiting_callbacks 0\n") != std::string::npos;
  }));
  EXPECT_THAT(daemon.get("/metrics").body,
              HasSubstr("isomesh_callback_attempts_total{result=\"delivered\"} 1\n"));
}

TEST_F(CallbacksTest, AReceiverThatHangsHoldsUpNoJob) {
  const Receiver receiver({0});
  const Daemon daemon(folder_ / "data", "127.0.0.1:0", options_for(folder_, receiver));
  const Volume volume = upload(daemon, sphere_upload());
  for (int n = 0; n < 12; ++n) {
    const Job job = submit(daemon, volume, 90 + n, callback_to(receiver));
    EXPECT_EQ(daemon.client().wait(job.id).state, JobState::kSucceeded);
  }
}

TEST_F(CallbacksTest, GoToListedAddressesAlone) {
  const Receiver receiver;
  const Daemon daemon(folder_ / "data", "127.0.0.1:0", options_for(folder_, receiver));
  const Daemon none;
  const std::string allowed = receiver.url() + "/hooks/iso";
  for (const Daemon* each : {&daemon, &none}) {
    const Volume volume = upload(*each, sphere_upload());
    const auto answer_to = [&](const std::string& callback) {
      return each->send(
          "POST", "/v1/jobs",
          R"({"volume": ")" + volume.id + R"(", "iso": 100, "callback": )" + callback + "}");
    };
    for (const std::string& url :
         {receiver.url() + "/other", std::string("http://localhost:1/hooks"),
          std::string("file:///etc/passwd"), std::string("hooks")}) {
      EXPECT_TRUE(blames(answer_to(R"({"url": ")" + url + "\"}"), "callback.url")) << url;
    }
    EXPECT_TRUE(blames(answer_to("{}"), "callback.url"));
    EXPECT_TRUE(blames(answer_to(R"({"url": 1})"), "callback.url"));
    EXPECT_TRUE(blames(answer_to(R"({"url": "x", "secret": "y"})"), "callback.secret"));
    EXPECT_TRUE(blames(answer_to("\"x\""), "callback"));
    EXPECT_EQ(answer_to("null").status, 202);
    EXPECT_EQ(answer_to(R"({"url": ")" + allowed + "\"}").status, each == &daemon ? 202 : 400);
  }
}

TEST_F(CallbacksTest, TheCommandAsksForThem) {
  const Receiver receiver;
  const Daemon daemon(folder_ / "data", "127.0.0.1:0", options_for(folder_, receiver));
  const Volume volume = upload(daemon, sphere_upload());
  const Finished result = daemon.command(
      {"submit", volume.id, "--iso", "100", "--callback", receiver.url() + "/hooks"});
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_TRUE(receiver.gets(1));
}

TEST_F(CallbacksTest, AuthoritiesThatCannotBeUsedAreRefusedAtTheStartAndByTheCheck) {
  write_file(folder_ / "none.pem", "no certificate");
  for (const std::string name : {"none.pem", "absent.pem"}) {
    const std::vector<std::string> options = {"--data", folder_ / "data", "--callback-ca",
                                              folder_ / name};
    for (const std::vector<std::string>& begin : std::vector<std::vector<std::string>>{
             {ISOMESHD, "--listen", "127.0.0.1:0"}, {ISOMESHD, "check"}}) {
      std::vector<std::string> command = begin;
      command.insert(command.end(), options.begin(), options.end());
      const Finished told = run(command);
      EXPECT_EQ(told.status, 1) << name;
      EXPECT_THAT(told.output + told.errors, HasSubstr("callback-ca")) << name;
      EXPECT_THAT(told.output + told.errors, HasSubstr("cannot be read")) << name;
    }
  }
}

TEST_F(CallbacksTest, NeedASecretAndAnAddress) {
  write_file(folder_ / "secret", kSecret);
  for (const std::vector<std::string>& wrong : std::vector<std::vector<std::string>>{
           {"--callback-allow", "https://ris.example.org/"},
           {"--callback-allow", "ris.example.org", "--callback-secret-file", folder_ / "secret"},
           {"--callback-allow", "https://ris.example.org/", "--callback-secret-file",
            folder_ / "absent"}}) {
    std::vector<std::string> command = {ISOMESHD, "--data", folder_ / "data", "--listen",
                                        "127.0.0.1:0"};
    command.insert(command.end(), wrong.begin(), wrong.end());
    const Finished result = run(command);
    EXPECT_EQ(result.status, 1);
    EXPECT_THAT(result.errors, HasSubstr("callback"));
    EXPECT_THAT(result.errors, Not(HasSubstr(kSecret)));
  }
}

}  // namespace
}  // namespace isomesh
