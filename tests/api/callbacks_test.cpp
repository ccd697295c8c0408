// Callbacks of the running daemon to a receiver of the test's.
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/api/problems.h"
#include "tests/support/enumerators.h"
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
  return result.line();
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
  const Daemon daemon(folder_ / "data", "127.0.0.1:0",
                      with(options_for(folder_, receiver), {"--job-memory", "1"}));
  const Job failed = submit(daemon, upload(daemon, sphere_upload()), 100, callback_to(receiver));
  ASSERT_TRUE(receiver.gets(1));
  EXPECT_EQ(job_from_json(receiver.received().at(0).body).state, JobState::kFailed);
  EXPECT_EQ(job_from_json(receiver.received().at(0).body).id, failed.id);
}

TEST_F(CallbacksTest, OfACancelledJobComesToo) {
  const Receiver receiver;
  const Daemon daemon(folder_ / "data", "127.0.0.1:0",
                      with(options_for(folder_, receiver), {"--workers", "1"}));
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
  const std::string delivered = "isomesh_callback_attempts_total{result=\"delivered\"} 1\n";
  EXPECT_TRUE(
      eventually([&] { return daemon.get("/metrics").body.find(delivered) != std::string::npos; }));
  EXPECT_THAT(daemon.get("/metrics").body, HasSubstr("isomesh_waiting_callbacks 0\n"));
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
      return each->send("POST", "/v1/jobs", job_body(volume.id, 100, R"("callback": )" + callback));
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
    for (const std::vector<std::string>& verb :
         std::vector<std::vector<std::string>>{{}, {"check"}}) {
      const Finished told =
          refused_start(folder_ / "data", with({"--callback-ca", folder_ / name}, verb));
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
    const Finished result = refused_start(folder_ / "data", wrong);
    EXPECT_EQ(result.status, 1);
    EXPECT_THAT(result.errors, HasSubstr("callback"));
    EXPECT_THAT(result.errors, Not(HasSubstr(kSecret)));
  }
}

// --- Secrets in addresses

// A callback's address may hold a secret. It is its job's alone: no mesh and no line of the log has
// it.
const std::string kKeyInUrl = "c9a1f0e2-not-for-others";

class CallbackSecret : public testing::Test {
 protected:
  // All of a surface; a ZIP is for labels.
  static std::vector<std::string> formats() {
    std::vector<std::string> all = names<MeshFormat>();
    std::erase(all, "zip");
    return all;
  }

  // A mesh in every format, with everything that it may carry.
  static std::string everything() {
    return R"("normals": true, "formats": )" + json(formats()).dump();
  }

  std::string callback() const {
    return R"("callback": {"url": ")" + receiver_.url() + "/hooks/iso?key=" + kKeyInUrl + "\"}";
  }

  void expect_clean_meshes(const Job& job) const {
    ASSERT_TRUE(job.mesh);
    EXPECT_EQ(job.mesh->files.size(), formats().size());
    for (const auto& [format, file] : job.mesh->files) {
      const std::string bytes = daemon_.get(file.href).body;
      EXPECT_EQ(bytes.size(), file.bytes);
      for (const std::string& word : {kKeyInUrl, receiver_.url(), std::string("callback")}) {
        EXPECT_EQ(bytes.find(word), std::string::npos) << to_string(format) << " holds " << word;
      }
    }
  }

  TemporaryFolder folder_;
  const Receiver receiver_{{503, 204}};  // the first attempt fails, which is logged as well
  Daemon daemon_{folder_ / "data", "127.0.0.1:0", options_for(folder_, receiver_)};
};

TEST_F(CallbackSecret, StandsInNoMeshAlsoWhenAnotherJobTakesIt) {
  const Job asked = finished_job(daemon_, callback() + ", " + everything());
  ASSERT_TRUE(asked.parameters.callback);
  expect_clean_meshes(asked);
  const Volume volume = daemon_.client().volume(asked.parameters.volume);
  const Job other =
      daemon_.client().wait(submit(daemon_, volume, *asked.parameters.iso, everything()).id);
  EXPECT_TRUE(other.reused);
  EXPECT_FALSE(other.parameters.callback);
  expect_clean_meshes(other);
}

TEST_F(CallbackSecret, StandsInNoLineOfTheLog) {
  const Job job = finished_job(daemon_, callback());
  ASSERT_TRUE(receiver_.gets(2));
  // Refused: an address that nobody has listed, and a request that has no callbacks.
  const std::string elsewhere = "http://elsewhere.example/?key=" + kKeyInUrl;
  for (const std::string& url : {elsewhere, "nonsense " + kKeyInUrl}) {
    const json body = {
        {"volume", job.parameters.volume}, {"iso", 100}, {"callback", {{"url", url}}}};
    EXPECT_EQ(daemon_.send("POST", "/v1/jobs", body.dump()).status, 400);
  }
  EXPECT_EQ(daemon_.send("POST", "/v1/mesh?iso=1&callback=" + kKeyInUrl, "x").status, 400);
  EXPECT_EQ(daemon_.get("/v1/estimate?iso=1&callback=" + kKeyInUrl).status, 400);
  EXPECT_EQ(daemon_.stop(), 0);
  EXPECT_THAT(daemon_.errors(), HasSubstr("callback"));
  EXPECT_THAT(daemon_.errors(), Not(HasSubstr(kKeyInUrl)));
}

}  // namespace
}  // namespace isomesh
