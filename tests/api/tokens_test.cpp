// Who may ask what, where tokens are configured.
#include <algorithm>
#include <csignal>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/api/problems.h"

namespace isomesh {
namespace {

using namespace test;
using testing::HasSubstr;
using testing::Not;

Headers bearer(const std::string& token) { return {{"Authorization", "Bearer " + token}}; }

class TokensTest : public testing::Test {
 protected:
  // A new token, which the file knows from then on.
  std::string made(const std::string& name, const std::string& role) const {
    const Finished result = run({ISOMESHD, "token", "add", name, "--role", role, "--into", file_});
    EXPECT_EQ(result.status, 0) << result.errors;
    return result.line();
  }

  const TemporaryFolder folder_;
  const std::string file_ = folder_ / "tokens";
  const std::string ann_ = made("ann", "user");
  const std::string ct_ = made("ct", "user");
  const std::string mr_ = made("mr", "user");
  const std::string boss_ = made("boss", "admin");
  const std::string probe_ = made("probe", "monitor");
  Daemon daemon_{std::vector<std::string>{"--tokens", file_}};
};

TEST_F(TokensTest, WithoutAKnownOneNothingIsServed) {
  const std::string cut = ct_.substr(0, ct_.size() - 1);
  for (const Headers& headers :
       {Headers{}, bearer("isomesh_unknown"), bearer(cut), bearer(""), bearer(ct_ + "x"),
        Headers{{"Authorization", "Basic " + ct_}}, Headers{{"Authorization", ct_}},
        Headers{{"Authorization", "Bearer " + ct_}, {"Authorization", "Bearer " + ct_}}}) {
    for (const std::string path : {"/v1/jobs", "/v1/volumes", "/v1/jobs/0123", "/v1", "/v1/none"}) {
      const Answer answer = daemon_.get(path, headers);
      EXPECT_TRUE(is_problem(answer, ErrorCode::kUnauthorized)) << path;
      EXPECT_EQ(answer.header("www-authenticate"), "Bearer realm=\"isomesh\"");
    }
    EXPECT_TRUE(
        is_problem(daemon_.send("POST", "/v1/jobs", "{}", headers), ErrorCode::kUnauthorized));
    EXPECT_TRUE(is_problem(daemon_.send("DELETE", "/v1/volumes/0123", "", headers),
                           ErrorCode::kUnauthorized));
  }
  EXPECT_EQ(daemon_.get("/v1/jobs", bearer(ct_)).status, 200);
}

TEST_F(TokensTest, WhatTellsNothingIsOpen) {
  for (const std::string path : {"/livez", "/openapi.yaml"}) {
    EXPECT_EQ(daemon_.get(path).status, 200) << path;
  }
  // /readyz does not wait for a slow check, so it may become ready later.
  EXPECT_TRUE(eventually([&] { return daemon_.get("/readyz").status == 200; }));
}

TEST_F(TokensTest, ARoleReachesAsFarAsItSays) {
  EXPECT_EQ(daemon_.get("/v1/jobs", bearer(boss_)).status, 200);
  EXPECT_TRUE(is_problem(daemon_.get("/v1/jobs", bearer(probe_)), ErrorCode::kForbidden));
  EXPECT_TRUE(is_problem(daemon_.get("/v1/pacs/main/series?date=20261130", bearer(probe_)),
                         ErrorCode::kForbidden));
  EXPECT_TRUE(is_problem(daemon_.get("/metrics"), ErrorCode::kUnauthorized));
  EXPECT_TRUE(is_problem(daemon_.get("/metrics", bearer(ct_)), ErrorCode::kForbidden));
  for (const std::string& token : {boss_, probe_}) {
    const Answer metrics = daemon_.get("/metrics", bearer(token));
    EXPECT_EQ(metrics.status, 200);
    EXPECT_THAT(metrics.header("content-type"), HasSubstr("application/openmetrics-text"));
    EXPECT_THAT(metrics.body, HasSubstr("isomesh_running_jobs 0\n"));
  }
}

TEST_F(TokensTest, AnAdministratorErasesWhatItSees) {
  const RawUpload sphere = sphere_upload();
  const std::string target = "/v1/volumes?" + sphere.query;
  const Answer uploaded = daemon_.send("POST", target, sphere.bytes, bearer(ct_));
  ASSERT_EQ(uploaded.status, 201) << uploaded.body;
  const std::string volume = "/v1/volumes/" + volume_from_json(uploaded.body).id;
  EXPECT_EQ(daemon_.send("DELETE", volume, "", bearer(boss_)).status, 204);
  EXPECT_EQ(daemon_.get(volume, bearer(boss_)).status, 404);
  EXPECT_EQ(daemon_.get(volume, bearer(ct_)).status, 404);
}

TEST_F(TokensTest, LabelsHaveTheNamesOfTheOwnRecord) {
  const auto segmentation = [](const std::string& name) {
    std::string file =
        "NRRD0004\ntype: unsigned char\ndimension: 3\nsizes: 4 4 4\nencoding: raw\n"
        "space: left-posterior-superior\nspace directions: (1,0,0) (0,1,0) (0,0,1)\n"
        "space origin: (0,0,0)\nSegment0_ID:=one\nSegment0_LabelValue:=1\nSegment0_Layer:=0\n"
        "Segment0_Name:=" +
        name + "\n\n" + std::string(64, '\0');
    file[file.size() - 30] = '\1';
    return file;
  };
  for (const auto& [token, name] :
       {std::pair{ann_, "Lung"}, {ct_, "Liver"}, {boss_, "Spleen"}, {mr_, "Heart"}}) {
    const Answer uploaded = daemon_.send("POST", "/v1/volumes", segmentation(name), bearer(token));
    ASSERT_EQ(uploaded.status, 201) << uploaded.body;
    const std::string volume = volume_from_json(uploaded.body).id;
    const Answer accepted = daemon_.send(
        "POST", "/v1/jobs", R"({"labels": "all", "volume": ")" + volume + R"("})", bearer(token));
    ASSERT_EQ(accepted.status, 202) << accepted.body;
    EXPECT_THAT(accepted.body, HasSubstr(name));
  }
}

// Nothing tells that something of another owner exists.
TEST_F(TokensTest, ATokenSeesItsOwnAloneAndAnAdministratorAll) {
  Client ct({.server = daemon_.url(), .token = ct_});
  const RawUpload sphere = sphere_upload();
  const Answer uploaded =
      daemon_.send("POST", "/v1/volumes?" + sphere.query, sphere.bytes, bearer(ct_));
  ASSERT_EQ(uploaded.status, 201) << uploaded.body;
  JobParameters parameters;
  parameters.volume = volume_from_json(uploaded.body).id;
  parameters.iso = 100;
  const Job job = ct.wait(ct.submit(parameters).id);
  const std::string of_job = "/v1/jobs/" + job.id;
  const std::string of_volume = "/v1/volumes/" + parameters.volume;
  for (const std::string& path :
       {of_job, of_job + "/mesh.drc", of_job + "/mesh.mtl", of_job + "/events", of_volume,
        of_volume + "/histogram", of_volume + "/labels", of_volume + "/slice.png",
        of_volume + "/preview"}) {
    EXPECT_TRUE(is_problem(daemon_.get(path, bearer(mr_)), ErrorCode::kNotFound)) << path;
    EXPECT_EQ(daemon_.get(path, bearer(ct_)).status, 200) << path;
    EXPECT_EQ(daemon_.get(path, bearer(boss_)).status, 200) << path;
  }
  EXPECT_THAT(daemon_.get("/v1/jobs", bearer(mr_)).body, Not(HasSubstr(job.id)));
  EXPECT_THAT(daemon_.get("/v1/volumes", bearer(mr_)).body, Not(HasSubstr(parameters.volume)));
  EXPECT_THAT(daemon_.get("/v1/jobs", bearer(boss_)).body, HasSubstr(job.id));
  for (const std::string& path : {of_job, of_volume}) {
    EXPECT_TRUE(is_problem(daemon_.send("DELETE", path, "", bearer(mr_)), ErrorCode::kNotFound));
  }
  EXPECT_TRUE(
      is_problem(daemon_.send("POST", "/v1/jobs", job_body(parameters.volume, 1), bearer(mr_)),
                 ErrorCode::kNotFound));
  // The same samples again are the other's own then.
  EXPECT_EQ(daemon_.send("POST", "/v1/volumes?" + sphere.query, sphere.bytes, bearer(mr_)).status,
            201);
  EXPECT_EQ(daemon_.get(of_volume, bearer(mr_)).status, 200);
}

// The queue is filled while no job runs, so that nothing depends on who is faster.
TEST_F(TokensTest, AnOwnersJobWaitsForOneRunningJobAWorkerHoweverManyAnotherHasQueued) {
  constexpr int kWorkers = 2;
  const TemporaryFolder data;
  const RawUpload sphere = sphere_upload();
  std::string volume;
  const auto submit_as = [&](const Daemon& daemon, const std::string& token, int iso) {
    JobParameters parameters;
    parameters.volume = volume;
    parameters.iso = iso;
    return Client({.server = daemon.url(), .token = token}).submit(parameters).id;
  };
  std::vector<std::string> many;
  std::string one;
  {
    Daemon idle(data / "data", "127.0.0.1:0", {"--tokens", file_, "--workers", "0"});
    for (const std::string& token : {ct_, mr_}) {
      const Answer uploaded =
          idle.send("POST", "/v1/volumes?" + sphere.query, sphere.bytes, bearer(token));
      ASSERT_EQ(uploaded.status, 201) << uploaded.body;
      volume = volume_from_json(uploaded.body).id;
    }
    for (int n = 0; n < 12; ++n) many.push_back(submit_as(idle, ct_, 90 + n));
    one = submit_as(idle, mr_, 100);
    ASSERT_EQ(idle.stop(), 0);
  }
  const Daemon daemon(data / "data", "127.0.0.1:0",
                      {"--tokens", file_, "--workers", std::to_string(kWorkers)});
  const std::string started =
      Client({.server = daemon.url(), .token = mr_}).wait(one).started.value();
  Client ct({.server = daemon.url(), .token = ct_});
  const auto is_before = [&](const std::string& id) {
    return ct.wait(id).started.value() < started;
  };
  EXPECT_LE(std::ranges::count_if(many, is_before), kWorkers);
}

TEST_F(TokensTest, TheCommandSendsItAndSaysWhatIsMissing) {
  const Finished refused = daemon_.command({"list"});
  EXPECT_EQ(refused.status, 1);
  EXPECT_THAT(refused.errors, HasSubstr("token"));
  EXPECT_EQ(daemon_.command({"--token", ct_, "list"}).status, 0);
  EXPECT_EQ(run({ISOMESH, "--server", daemon_.url(), "list"}, {"ISOMESH_TOKEN=" + ct_}).status, 0);
}

TEST_F(TokensTest, AreReadAgainOnSighup) {
  const std::string later = made("later", "user");
  EXPECT_EQ(daemon_.get("/v1/jobs", bearer(later)).status, 401);
  daemon_.send_signal(SIGHUP);
  EXPECT_TRUE(eventually([&] { return daemon_.get("/v1/jobs", bearer(later)).status == 200; }));
  // One that became unreadable changes nothing.
  write_file(file_, "half a line");
  daemon_.send_signal(SIGHUP);
  EXPECT_TRUE(eventually([&] { return daemon_.errors().find("stays") != std::string::npos; }));
  EXPECT_EQ(daemon_.get("/v1/jobs", bearer(later)).status, 200);
}

TEST_F(TokensTest, TheLogNamesTheOwnerAndNeverTheToken) {
  daemon_.get("/v1/jobs?state=queued", bearer(ct_));
  daemon_.get("/v1/jobs", bearer("isomesh_guessed"));
  EXPECT_EQ(daemon_.stop(), 0);
  EXPECT_THAT(daemon_.errors(), HasSubstr("token=ct"));
  for (const std::string& secret : {ct_, std::string("isomesh_guessed"), std::string("queued")}) {
    EXPECT_THAT(daemon_.errors(), Not(HasSubstr(secret)));
  }
}

TEST(TokenCommand, PrintsTheTokenAndItsLine) {
  const Finished result = run({ISOMESHD, "token", "add", "ct"});
  EXPECT_EQ(result.status, 0);
  EXPECT_THAT(result.output, testing::MatchesRegex("isomesh_[0-9a-f]{64}\nct user [0-9a-f]{64}\n"));
  EXPECT_EQ(run({ISOMESHD, "token", "add", "c t"}).status, 1);
  EXPECT_EQ(run({ISOMESHD, "token", "add", "ct", "--role", "root"}).status, 1);
  EXPECT_EQ(run({ISOMESHD, "token", "add"}).status, 2);
}

// The output of `isomeshd token` with that file.
Finished token_command(const std::vector<std::string>& arguments, const std::string& file) {
  return run(with(with({ISOMESHD, "token"}, arguments), {"--tokens", file}));
}

// A token that nobody has seen would stay in the file.
TEST(TokenCommand, StoresNothingThatItCannotTell) {
  const TemporaryFolder folder;
  const std::string file = folder / "tokens";
  EXPECT_NE(run({"/bin/sh", "-c", ISOMESHD " token add ct --into " + file + " > /dev/full"}).status,
            0);
  EXPECT_FALSE(std::filesystem::exists(file));
}

TEST(TokenCommand, ListsAndRevokes) {
  const TemporaryFolder folder;
  const std::string file = folder / "tokens";
  write_file(file, "# of the ward\n");
  std::filesystem::permissions(file, std::filesystem::perms(0600));
  EXPECT_EQ(token_command({"list"}, file).status, 1) << "the file contains no token";
  ASSERT_EQ(token_command({"add", "ct"}, file).status, 0);
  ASSERT_EQ(token_command({"add", "ct"}, file).status, 0);
  ASSERT_EQ(token_command({"add", "boss", "--role", "admin"}, file).status, 0);
  const Finished two_roles = token_command({"add", "boss"}, file);
  EXPECT_EQ(two_roles.status, 1);
  EXPECT_THAT(two_roles.errors, HasSubstr("boss already has the role admin"));

  const Finished list = token_command({"list"}, file);
  EXPECT_THAT(list.output,
              testing::MatchesRegex(
                  "ct user [0-9a-f]{12}\nct user [0-9a-f]{12}\nboss admin [0-9a-f]{12}\n"));
  const std::string first = list.output.substr(8, 12);
  EXPECT_THAT(token_command({"revoke", "ct", first}, file).output, HasSubstr("revoked 1 token;"));
  EXPECT_THAT(token_command({"list"}, file).output, Not(HasSubstr(first)));
  EXPECT_EQ(token_command({"revoke", "ct", first}, file).status, 1);
  EXPECT_EQ(token_command({"revoke", "ct", ""}, file).status, 2) << "as a script's unset variable";
  EXPECT_EQ(token_command({"revoke", "nobody"}, file).status, 1);
  EXPECT_EQ(token_command({"revoke", "ct"}, file).status, 0);
  const Finished last = token_command({"revoke", "boss"}, file);
  EXPECT_EQ(last.status, 1);
  EXPECT_THAT(last.errors, HasSubstr("no token would be left"));
  EXPECT_EQ(run({ISOMESHD, "token", "list"}).status, 1);
  EXPECT_EQ(run({ISOMESHD, "token", "ct"}).status, 2);
  EXPECT_EQ(std::filesystem::status(file).permissions(), std::filesystem::perms(0600));
}

// A daemon that reads the file by its own name would keep revoked tokens.
TEST(TokenCommand, WritesThroughLinks) {
  const TemporaryFolder folder;
  const std::string real = folder / "secret" / "tokens";
  const std::string link = folder / "tokens";
  std::filesystem::create_directory(folder / "secret");
  std::filesystem::create_symlink("../chained", folder / "secret" / "link");
  std::filesystem::create_symlink(real, folder / "chained");
  std::filesystem::create_symlink("secret/link", link);
  ASSERT_EQ(token_command({"add", "ct"}, link).status, 0) << "the last link leads to no file yet";
  std::filesystem::permissions(real, std::filesystem::perms(0640));
  ASSERT_EQ(run({ISOMESHD, "token", "add", "mr", "--into", link}).status, 0);
  EXPECT_EQ(std::ranges::count(token_command({"list"}, real).output, '\n'), 2);
  ASSERT_EQ(token_command({"revoke", "ct"}, link).status, 0);
  EXPECT_THAT(token_command({"list"}, real).output, testing::StartsWith("mr user "));
  EXPECT_EQ(std::filesystem::status(real).permissions(), std::filesystem::perms(0640));
  for (const std::string each :
       {folder / "secret" / "link", folder / "chained", folder / "tokens"}) {
    EXPECT_TRUE(std::filesystem::is_symlink(each)) << each;
  }

  std::filesystem::create_symlink("loop", folder / "loop");
  const Finished looped = token_command({"add", "ct"}, folder / "loop");
  EXPECT_EQ(looped.status, 1);
  EXPECT_THAT(looped.errors, HasSubstr("too many symbolic links"));
  EXPECT_EQ(looped.output, "");
}

TEST(TokenCommand, ManyAtOnceLoseNoLine) {
  const TemporaryFolder folder;
  const std::string file = folder / "tokens";
  ASSERT_EQ(token_command({"add", "first"}, file).status, 0);
  {
    std::vector<std::jthread> threads;
    for (int n = 0; n < 8; ++n) {
      threads.emplace_back([&, n] {
        EXPECT_EQ(token_command({"add", "many" + std::to_string(n)}, file).status, 0);
      });
    }
  }
  const std::string lines = token_command({"list"}, file).output;
  EXPECT_EQ(std::ranges::count(lines, '\n'), 9);
}

TEST_F(TokensTest, ARevokedTokenIsRefusedAfterSighupAndItsStreamsOfEventsEnd) {
  const Connection connection(daemon_.url());
  connection.send(request("GET", "/v1/events", "", bearer(ct_)));
  EXPECT_THAT(connection.receive_some(), HasSubstr("200 OK"));
  ASSERT_EQ(token_command({"revoke", "ct"}, file_).status, 0);
  daemon_.send_signal(SIGHUP);
  std::string rest;
  do {
    rest = connection.receive_some();  // throws if the stream stays open
  } while (!rest.empty());
  EXPECT_EQ(daemon_.get("/v1/jobs", bearer(ct_)).status, 401);
}

TEST(Tokens, LetTheDaemonListenBeyondThisMachine) {
  const TemporaryFolder folder;
  ASSERT_EQ(run({ISOMESHD, "token", "add", "ct", "--into", folder / "tokens"}).status, 0);
  const Daemon daemon(folder / "data", "0.0.0.0:0", {"--tokens", folder / "tokens"});
  EXPECT_EQ(daemon.get("/livez").status, 200);
  EXPECT_EQ(daemon.get("/v1/jobs").status, 401);
}

TEST(Tokens, AFileThatCannotBeTrustedIsRefused) {
  const TemporaryFolder folder;
  write_file(folder / "tokens", "ct user 00\n");
  for (const std::string file : {"tokens", "absent"}) {
    const Finished result = refused_start(folder / "data", {"--tokens", folder / file});
    EXPECT_EQ(result.status, 1);
    EXPECT_THAT(result.errors, HasSubstr("tokens"));
  }
}

}  // namespace
}  // namespace isomesh
