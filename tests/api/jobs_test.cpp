// Jobs over HTTP: submitting, waiting, cancelling, listing.
#include <algorithm>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/api/problems.h"

namespace isomesh {
namespace {

using namespace test;

class JobsTest : public testing::Test {
 protected:
  Answer post(const std::string& body, const Headers& headers = {}) {
    return daemon_.send("POST", "/v1/jobs", body, headers);
  }
  Answer post_with(const std::string& members, const Headers& headers = {}) {
    return post(job_body(volume_.id, 100, members), headers);
  }

  Daemon daemon_;
  const Volume volume_ = upload(daemon_, sphere_upload());
};

TEST_F(JobsTest, AJobIsAcceptedAndRuns) {
  const Answer answer = post_with("");
  ASSERT_EQ(answer.status, 202) << answer.body;
  const Job job = job_from_json(answer.body);
  EXPECT_EQ(answer.header("location"), "/v1/jobs/" + job.id);
  EXPECT_EQ(answer.header("cache-control"), "no-store");
  EXPECT_EQ(job.parameters.volume, volume_.id);
  const Job ended = daemon_.client().wait(job.id);
  EXPECT_EQ(ended.state, JobState::kSucceeded);
  EXPECT_EQ(ended.mesh->euler, 2);
  EXPECT_EQ(ended.mesh->files.at(MeshFormat::kDrc).href, "/v1/jobs/" + job.id + "/mesh.drc");
  for (const double stage : {ended.timing.queue, ended.timing.load, ended.timing.extract,
                             ended.timing.smooth, ended.timing.encode}) {
    EXPECT_GT(stage, 0);
    EXPECT_LE(stage, ended.timing.total);
  }
}

TEST_F(JobsTest, ACropBesideTheVolumeIsRefusedAtOnce) {
  const Answer answer = post_with(R"("crop": [[100, 0, 0], [120, 10, 10]])");
  EXPECT_TRUE(is_problem(answer, ErrorCode::kInvalidParameter)) << answer.body;
  EXPECT_THAT(answer.body, testing::HasSubstr("from (0, 0, 0) to (20, 19, 18) mm"));
  EXPECT_TRUE(daemon_.client().jobs().jobs.empty());
  EXPECT_EQ(post_with(R"("crop": [[2, 2, 2], [12, 12, 12]])").status, 202);
}

TEST_F(JobsTest, TheSameJobAgainTakesTheMeshAtOnce) {
  const Job first = finished_job(daemon_);
  const Answer answer = post_with("\"priority\": \"stat\"");
  ASSERT_EQ(answer.status, 202);
  const Job second = job_from_json(answer.body);
  EXPECT_NE(first.id, second.id);
  EXPECT_EQ(second.state, JobState::kSucceeded);
  EXPECT_FALSE(first.reused);
  EXPECT_TRUE(second.reused);
  const MeshFile& file = second.mesh->files.at(MeshFormat::kDrc);
  EXPECT_EQ(file.sha256, first.mesh->files.at(MeshFormat::kDrc).sha256);
  EXPECT_EQ(file.href, "/v1/jobs/" + second.id + "/mesh.drc");
  EXPECT_EQ(daemon_.get(file.href).status, 200);
}

TEST_F(JobsTest, AnIdempotencyKeyMakesARetrySafe) {
  const Headers key = {{"Idempotency-Key", "0b1c-7"}};
  const Job first = job_from_json(post_with("", key).body);
  const Answer again = post_with("", key);
  EXPECT_EQ(again.status, 202);
  EXPECT_EQ(again.header("location"), "/v1/jobs/" + first.id);
  EXPECT_EQ(job_from_json(again.body).id, first.id);
  EXPECT_TRUE(is_problem(post_with("\"passes\": 1", key), ErrorCode::kKeyReused));
  EXPECT_NE(job_from_json(post_with("\"passes\": 1").body).id, first.id);
  for (const std::string& wrong : {std::string("a b"), std::string(256, 'k')}) {
    EXPECT_TRUE(blames(post_with("", {{"Idempotency-Key", wrong}}), "Idempotency-Key"));
  }
}

TEST_F(JobsTest, PreferWaitAnswersWhenItIsDone) {
  const Answer answer = post_with("", {{"Prefer", "wait=30"}});
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(job_from_json(answer.body).state, JobState::kSucceeded);
  EXPECT_EQ(answer.header("location"), "/v1/jobs/" + job_from_json(answer.body).id);
}

TEST_F(JobsTest, APreferredWaitThatIsNoNumberIsRefused) {
  const std::string path = "/v1/jobs/" + finished_job(daemon_).id;
  for (const std::string wrong : {"inf", "nan", "1e999", ""}) {
    EXPECT_TRUE(blames(daemon_.get(path, {{"Prefer", "wait=" + wrong}}), "Prefer")) << wrong;
  }
  EXPECT_EQ(daemon_.get(path, {{"Prefer", "respond-async, wait=1; x=y"}}).status, 200);
}

// Three samples of air, fat and bone along each axis.
RawUpload said_ct() {
  std::vector<std::int16_t> samples(27, -1000);
  samples[13] = 1200;
  samples[14] = -50;
  return {.bytes = bytes_of(samples), .query = "dims=3,3,3&type=int16&modality=ct", .options = {}};
}

TEST_F(JobsTest, AnIsoValueMayBeNamed) {
  const RawUpload ct = said_ct();
  const Volume volume = upload(daemon_, ct);
  EXPECT_EQ(volume.modality, "CT");
  EXPECT_EQ(volume.presets.size(), 3U);
  for (const auto& [name, iso] :
       std::map<std::string, double>{{"skin", -300}, {"soft-tissue", -25}, {"bone", 250}}) {
    const Answer answer =
        daemon_.send("POST", "/v1/jobs?wait=30",
                     R"({"volume": ")" + volume.id + R"(", "iso": ")" + name + "\"}");
    ASSERT_EQ(answer.status, 200) << answer.body;
    EXPECT_EQ(job_from_json(answer.body).parameters.iso, iso);
    EXPECT_EQ(
        estimate_from_json(daemon_.get("/v1/estimate?volume=" + volume.id + "&iso=" + name).body)
            .iso,
        iso);
  }
  const Answer mesh = daemon_.send("POST", "/v1/mesh?iso=bone&" + ct.query, ct.bytes);
  ASSERT_EQ(mesh.status, 200) << mesh.body;
  EXPECT_EQ(job_from_json(daemon_.get(mesh.header("location")).body).parameters.iso, 250);
}

TEST_F(JobsTest, ANameThatTheVolumeDoesNotHaveIsRefusedWithThoseThatItHas) {
  const Volume ct = upload(daemon_, said_ct());
  const auto ask = [&](const Volume& volume, const std::string& name) {
    return post(R"({"volume": ")" + volume.id + R"(", "iso": ")" + name + "\"}");
  };
  const Answer of_ct = ask(ct, "segment");
  EXPECT_TRUE(blames(of_ct, "iso"));
  EXPECT_THAT(of_ct.body, testing::HasSubstr(R"(it has \"skin\", \"soft-tissue\" or \"bone\")"));
  const Answer of_another = ask(volume_, "bone");
  EXPECT_TRUE(blames(of_another, "iso"));
  EXPECT_THAT(of_another.body, testing::HasSubstr("it has none"));
  const Answer unknown = ask(ct, "teeth");
  EXPECT_TRUE(blames(unknown, "iso"));
  EXPECT_THAT(unknown.body, testing::HasSubstr("soft-tissue"));
}

TEST_F(JobsTest, AWaitEndsWhenItsTimeIsOver) {
  const Job job = long_job(daemon_);
  const Job seen = job_from_json(daemon_.get("/v1/jobs/" + job.id + "?wait=0.05").body);
  EXPECT_EQ(seen.state, JobState::kRunning);
  daemon_.client().cancel(job.id);
}

TEST_F(JobsTest, ARunningJobStopsWhenItIsCancelled) {
  const Job job = long_job(daemon_);
  const std::string path = "/v1/jobs/" + job.id;
  EXPECT_GT(job.progress, 0);
  const Answer answer = daemon_.send("DELETE", path);
  EXPECT_EQ(answer.status, 200);
  const Job ended = job_from_json(daemon_.get(path + "?wait=30").body);
  EXPECT_EQ(ended.state, JobState::kCancelled);
  EXPECT_FALSE(ended.mesh || ended.error);
  EXPECT_EQ(blobs_below(daemon_.data()).size(), 2U) << "the two volumes and nothing else";
  EXPECT_TRUE(eventually([&] { return files_below(daemon_.data() / "scratch").empty(); }));
  EXPECT_TRUE(is_problem(daemon_.get(path + "/mesh.drc"), ErrorCode::kCancelled));
}

TEST_F(JobsTest, AFinishedJobCannotBeCancelled) {
  const Job job = finished_job(daemon_);
  const Answer answer = daemon_.send("DELETE", "/v1/jobs/" + job.id + "?erase=false");
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(job_from_json(answer.body), job);
}

TEST_F(JobsTest, AFinishedJobIsErasedWithItsFiles) {
  const Job job = finished_job(daemon_);
  const std::string path = "/v1/jobs/" + job.id;
  const std::string blob = job.mesh->files.at(MeshFormat::kDrc).sha256;
  const Job equal = daemon_.client().submit(job.parameters);
  EXPECT_TRUE(blames(daemon_.send("DELETE", path + "?erase=no"), "erase"));
  EXPECT_EQ(daemon_.send("DELETE", path, "", {{"If-Match", "\"x\""}}).status, 412);
  EXPECT_EQ(daemon_.send("DELETE", path).status, 204);
  for (const char* part : {"", "/mesh.drc", "/events"}) {
    EXPECT_TRUE(is_problem(daemon_.get(path + part), ErrorCode::kNotFound)) << part;
  }
  EXPECT_EQ(daemon_.send("DELETE", path).status, 404);
  EXPECT_EQ(daemon_.get("/v1/jobs/" + equal.id + "/mesh.drc").status, 200);
  EXPECT_EQ(daemon_.send("DELETE", "/v1/jobs/" + equal.id).status, 204);
  const auto is_gone = [&] {
    const auto left = blobs_below(daemon_.data());
    return std::ranges::none_of(left, [&](const auto& file) { return file.ends_with(blob); });
  };
  EXPECT_TRUE(eventually(is_gone));
}

TEST_F(JobsTest, AReportTellsWhatWasMadeOfWhatAndHow) {
  const Job job = finished_job(daemon_);
  const std::string path = "/v1/jobs/" + job.id + "/report";
  const Answer answer = daemon_.get(path);
  ASSERT_EQ(answer.status, 200) << answer.body;
  const auto told = nlohmann::json::parse(answer.body);
  EXPECT_FALSE(told.at("version").get<std::string>().empty());
  EXPECT_FALSE(told.at("mesher").get<std::string>().empty());
  EXPECT_EQ(job_from_json(told.at("job").dump()), job);
  EXPECT_EQ(volume_from_json(told.at("volume").dump()),
            daemon_.client().volume(job.parameters.volume));
  EXPECT_EQ(daemon_.get(path, {{"If-None-Match", answer.header("etag")}}).status, 304);
  daemon_.client().erase_volume(job.parameters.volume);
  EXPECT_TRUE(nlohmann::json::parse(daemon_.get(path).body).at("volume").is_null());
}

TEST_F(JobsTest, AnErasedVolumeTakesItsJobsOnRequest) {
  const Job job = finished_job(daemon_);
  const std::string volume = "/v1/volumes/" + job.parameters.volume;
  EXPECT_TRUE(blames(daemon_.send("DELETE", volume + "?jobs=all"), "jobs"));
  EXPECT_EQ(daemon_.send("DELETE", volume + "?jobs=erase").status, 204);
  EXPECT_TRUE(is_problem(daemon_.get(volume), ErrorCode::kNotFound));
  EXPECT_TRUE(is_problem(daemon_.get("/v1/jobs/" + job.id), ErrorCode::kNotFound));
}

TEST_F(JobsTest, AMeshBeforeItsTimeIsNotReady) {
  const Job job = long_job(daemon_);
  EXPECT_TRUE(is_problem(daemon_.get("/v1/jobs/" + job.id + "/mesh.drc"), ErrorCode::kNotReady));
  daemon_.client().cancel(job.id);
}

TEST_F(JobsTest, WhatIsNotThereIsNotFound) {
  for (const std::string path :
       {"/v1/jobs/0123", "/v1/jobs/0123/mesh.drc", "/v1/volumes/0123", "/v1/nothing", "/v2/jobs",
        "/v1/jobs/", "/v1/jobs/0123/", "/v1/jobs/0123/mesh", "/v1/jobs/0123/mesh.exe",
        "/v1/jobs/..%2f..%2fetc%2fpasswd", "/v1/volumes/../../etc/passwd", "/v1//jobs",
        "/v1/volumes/0123/histogram", "/v1/volumes/0123/labels", "/v1/volumes/0123/slice.png",
        "/v1/volumes/0123/preview", "/v1/estimate?iso=1&volume=0123"}) {
    EXPECT_TRUE(is_problem(daemon_.get(path), ErrorCode::kNotFound)) << path;
  }
  EXPECT_TRUE(is_problem(daemon_.send("DELETE", "/v1/jobs/0123"), ErrorCode::kNotFound));
}

TEST_F(JobsTest, AJobForAnUnknownVolumeIsNotFound) {
  const Answer answer = post(R"({"volume": "0123", "iso": 1})");
  EXPECT_TRUE(is_problem(answer, ErrorCode::kNotFound));
  EXPECT_EQ(problem_from_json(answer.body).errors.at(0).field, "volume");
}

TEST_F(JobsTest, ABodyThatIsTooLargeIsRefused) {
  const std::string padding(65'000, ' ');
  EXPECT_EQ(post_with("\"passes\": 0" + padding).status, 202);
  EXPECT_TRUE(is_problem(post_with("\"passes\": 0" + padding + padding), ErrorCode::kTooLarge));
  EXPECT_TRUE(is_problem(answer_to(daemon_.url(),
                                   "POST /v1/jobs HTTP/1.1\r\nHost: localhost\r\n"
                                   "Transfer-Encoding: chunked\r\n\r\n" +
                                       chunked(padding + padding, 1000)),
                         ErrorCode::kTooLarge));
}

TEST_F(JobsTest, ManyClientsGetEachTheirOwn) {
  constexpr int kClients = 12;
  std::vector<std::string> triangles(kClients);
  std::vector<std::jthread> clients;
  for (int client = 0; client < kClients; ++client) {
    clients.emplace_back([&, client] {
      const double iso = 60 + 10 * (client % 3);
      const Job job = daemon_.client().wait(submit(daemon_, volume_, iso).id);
      EXPECT_EQ(job.state, JobState::kSucceeded);
      EXPECT_EQ(job.parameters.iso, iso);
      if (job.mesh)
        triangles[static_cast<std::size_t>(client)] =
            to_json(job.parameters) + std::to_string(job.mesh->triangles);
    });
  }
  clients.clear();
  EXPECT_EQ(std::set(triangles.begin(), triangles.end()).size(), 3U);
}

TEST(FullQueue, AnswersLater) {
  const Daemon daemon({"--max-queue", "1", "--workers", "1"});
  const Job running = long_job(daemon);
  Volume volume;
  volume.id = running.parameters.volume;
  const Job queued = submit(daemon, volume, 50);
  const Answer answer = daemon.send("POST", "/v1/jobs", job_body(volume.id, 50));
  EXPECT_TRUE(is_problem(answer, ErrorCode::kUnavailable));
  EXPECT_FALSE(answer.header("retry-after").empty());
  EXPECT_TRUE(is_problem(daemon.get("/readyz"), ErrorCode::kUnavailable));
  EXPECT_EQ(daemon.get("/livez").status, 200);
  EXPECT_EQ(job_from_json(daemon.send("DELETE", "/v1/jobs/" + queued.id).body).state,
            JobState::kCancelled);
  EXPECT_TRUE(eventually([&] { return daemon.get("/readyz").status == 200; }));
  daemon.client().cancel(running.id);
}

// --- What HTTP lets one say

TEST_F(JobsTest, AKeyOfTheWholeMeshIsOneJobToo) {
  const RawUpload sphere = sphere_upload();
  const std::string target = "/v1/mesh?" + sphere.query + "&iso=";
  const Headers key = {{"Idempotency-Key", "k"}};
  const Answer first = daemon_.send("POST", target + "100", sphere.bytes, key);
  ASSERT_EQ(first.status, 200);
  const Answer again = daemon_.send("POST", target + "100", sphere.bytes, key);
  EXPECT_EQ(again.header("location"), first.header("location"));
  EXPECT_TRUE(again.body == first.body);
  EXPECT_TRUE(
      is_problem(daemon_.send("POST", target + "101", sphere.bytes, key), ErrorCode::kKeyReused));
}

TEST_F(JobsTest, OnlyJsonIsTakenForJson) {
  for (const std::string type : {"text/plain", "application/x-www-form-urlencoded",
                                 "multipart/form-data; boundary=x", "application/jsonx"}) {
    EXPECT_TRUE(is_problem(daemon_.send("POST", "/v1/jobs", "{}", {{"Content-Type", type}}),
                           ErrorCode::kUnsupportedMedia))
        << type;
  }
  for (const std::string type : {"application/json", "Application/JSON; charset=utf-8"}) {
    EXPECT_TRUE(blames(daemon_.send("POST", "/v1/jobs", "{}", {{"Content-Type", type}}), "volume"));
  }
  EXPECT_TRUE(
      is_problem(daemon_.send("POST", "/v1/jobs", "{}",
                              {{"Content-Digest", "sha-256=:" + std::string(43, 'A') + "=:"}}),
                 ErrorCode::kDigestMismatch));
}

TEST_F(JobsTest, AnUnchangedJobIsNotSentAgain) {
  const Job job = finished_job(daemon_);
  const std::string path = "/v1/jobs/" + job.id;
  const std::string etag = daemon_.get(path).header("etag");
  ASSERT_FALSE(etag.empty());
  const Answer again = daemon_.get(path, {{"If-None-Match", etag}});
  EXPECT_EQ(again.status, 304);
  EXPECT_TRUE(again.body.empty());
  EXPECT_EQ(daemon_.get(path, {{"If-None-Match", "\"other\""}}).status, 200);
  EXPECT_TRUE(
      is_problem(daemon_.get(path, {{"If-Match", "\"other\""}}), ErrorCode::kPreconditionFailed));
  EXPECT_TRUE(is_problem(daemon_.send("DELETE", path, {}, {{"If-Match", "\"other\""}}),
                         ErrorCode::kPreconditionFailed));
  EXPECT_EQ(daemon_.send("DELETE", path, {}, {{"If-Match", etag}}).status, 204);
}

// Every item once, in the order of the whole list, whatever the page's size.
template <class Item>
void expect_pages(const Daemon& daemon, const std::string& list, const std::vector<Item>& whole,
                  std::vector<Item> (*items_of)(std::string_view)) {
  for (const std::size_t limit : {1U, 2U, 3U, 1000U}) {
    std::vector<Item> all;
    std::string cursor;
    do {
      const Answer answer = daemon.get(list + "?limit=" + std::to_string(limit) +
                                       (cursor.empty() ? "" : "&cursor=" + cursor));
      ASSERT_EQ(answer.status, 200) << answer.body;
      const std::vector<Item> page = items_of(answer.body);
      EXPECT_LE(page.size(), limit);
      all.insert(all.end(), page.begin(), page.end());
      const auto next = nlohmann::json::parse(answer.body)["next"];
      cursor = next.is_null() ? "" : next.get<std::string>();
    } while (!cursor.empty() && all.size() < 100);
    EXPECT_EQ(all, whole) << limit;
  }
  EXPECT_TRUE(blames(daemon.get(list + "?cursor=x"), "cursor"));
}

TEST_F(JobsTest, ListsComeInPages) {
  for (int n = 0; n < 5; ++n) finished_job(daemon_, "\"passes\": " + std::to_string(n));
  expect_pages<Job>(daemon_, "/v1/jobs", daemon_.client().jobs().jobs, jobs_from_json);
  for (char c = 'a'; c < 'e'; ++c) {
    daemon_.send("POST", "/v1/volumes?dims=10,10,10&type=uint8", std::string(1000, c));
  }
  const auto volumes = volumes_from_json(daemon_.get("/v1/volumes").body);
  EXPECT_EQ(volumes.size(), 5U);
  expect_pages<Volume>(daemon_, "/v1/volumes", volumes, volumes_from_json);
  const auto newest = volumes_from_json(daemon_.get("/v1/volumes?order=newest&limit=2").body);
  EXPECT_EQ(newest, (std::vector{volumes[4], volumes[3]}));
  // A cursor of one list is none of the other.
  const Answer jobs = daemon_.get("/v1/jobs?limit=1");
  const auto next = nlohmann::json::parse(jobs.body)["next"].get<std::string>();
  EXPECT_TRUE(blames(daemon_.get("/v1/volumes?cursor=" + next), "cursor"));
}

// Sent as it is made, unlike a list of the usual length.
TEST_F(JobsTest, ALongListComesInPieces) {
  const Job first = finished_job(daemon_);
  const std::string body = job_body(first.parameters.volume, 100);
  std::vector<std::string> ids = {first.id};
  while (ids.size() < 250) {
    ids.push_back(job_from_json(daemon_.send("POST", "/v1/jobs?wait=30", body).body).id);
  }
  std::ranges::reverse(ids);
  const auto expect_page = [&](const Answer& answer, std::size_t begin, std::size_t end) {
    EXPECT_EQ(answer.status, 200) << answer.body;
    EXPECT_EQ(answer.header("content-type"), "application/json");
    EXPECT_EQ(answer.header("cache-control"), "no-store");
    std::vector<std::string> listed;
    for (const Job& job : jobs_from_json(answer.body)) listed.push_back(job.id);
    EXPECT_EQ(listed, std::vector(ids.begin() + static_cast<std::ptrdiff_t>(begin),
                                  ids.begin() + static_cast<std::ptrdiff_t>(end)));
    const auto next = nlohmann::json::parse(answer.body)["next"];
    return next.is_null() ? "" : "&cursor=" + next.get<std::string>();
  };
  const Answer most = daemon_.get("/v1/jobs?limit=220");
  EXPECT_EQ(most.header("transfer-encoding"), "chunked");
  const std::string next = expect_page(most, 0, 220);
  EXPECT_EQ(expect_page(daemon_.get("/v1/jobs?limit=220" + next), 220, 250), "");
  EXPECT_EQ(expect_page(daemon_.get("/v1/jobs?limit=1000"), 0, 250), "");
  EXPECT_EQ(expect_page(daemon_.get("/v1/jobs?limit=1000&state=succeeded"), 0, 250), "");
  EXPECT_EQ(expect_page(daemon_.get("/v1/jobs?state=failed"), 0, 0), "");
  EXPECT_NE(expect_page(daemon_.get("/v1/jobs"), 0, 100), "") << "a page of the usual length";
  Client client = daemon_.client();
  EXPECT_EQ(client.jobs({.state = JobState::kSucceeded}, client.jobs().next).jobs.front().id,
            ids[100]);
  const Answer old = answer_to(daemon_.url(), "GET /v1/jobs?limit=1000 HTTP/1.0\r\n\r\n");
  EXPECT_EQ(expect_page(old, 0, 250), "");
  const Answer plain = daemon_.get("/v1/jobs?limit=1000", {{"Accept-Encoding", "gzip, br"}});
  EXPECT_EQ(plain.header("content-encoding"), "");
  EXPECT_EQ(expect_page(plain, 0, 250), "");
}

}  // namespace
}  // namespace isomesh
