// Streams of events, and pages of other origins.
#include <map>
#include <string>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "tests/api/daemon.h"
#include "tests/api/problems.h"

namespace isomesh {
namespace {

using namespace test;
using testing::ElementsAre;
using testing::HasSubstr;

struct Event {
  std::uint64_t id = 0;
  std::string name;
  std::string data;
};

// The events of a stream's text (WHATWG, "Server-sent events").
std::vector<Event> events_in(const std::string& text) {
  std::vector<Event> events;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = text.find("\n\n", begin);
    std::map<std::string, std::string> fields;
    for (std::size_t line = begin; line < end;) {
      const std::size_t next = std::min(text.find('\n', line), end);
      const std::size_t colon = text.find(": ", line);
      fields[text.substr(line, colon - line)] = text.substr(colon + 2, next - colon - 2);
      line = next + 1;
    }
    if (fields.contains("event")) {
      events.push_back({std::stoull(fields["id"]), fields["event"], fields["data"]});
    }
    begin = end + 2;
  }
  return events;
}

class EventsTest : public testing::Test {
 protected:
  Answer listen(const Job& job, const Headers& headers = {}) const {
    return daemon_.get("/v1/jobs/" + job.id + "/events", headers);
  }

  const Daemon daemon_;
};

TEST_F(EventsTest, TellAJobsWayAndEndWithIt) {
  const Job job = submit(daemon_, upload(daemon_, sphere_upload()), 100);
  const Answer answer = listen(job);
  EXPECT_EQ(answer.status, 200);
  EXPECT_EQ(answer.header("content-type"), "text/event-stream");
  EXPECT_EQ(answer.header("cache-control"), "no-store");
  EXPECT_THAT(answer.body, testing::StartsWith("retry: "));
  const std::vector<Event> events = events_in(answer.body);
  ASSERT_GE(events.size(), 2U);
  for (std::size_t n = 1; n < events.size(); ++n) EXPECT_LT(events[n - 1].id, events[n].id);
  EXPECT_EQ(events.front().name, "stage");
  EXPECT_EQ(job_event_from_json(events.front().data).state, JobState::kQueued);
  EXPECT_EQ(events.back().name, "done");
  EXPECT_EQ(job_from_json(events.back().data),
            job_from_json(daemon_.get("/v1/jobs/" + job.id).body));
}

TEST_F(EventsTest, ProgressGrows) {
  const Job job = long_job(daemon_);
  const Connection connection(daemon_.url());
  connection.send(request("GET", "/v1/jobs/" + job.id + "/events"));
  std::string heard;
  std::vector<JobEvent> progress;
  while (progress.size() < 3) {
    const std::string more = connection.receive_some();
    ASSERT_FALSE(more.empty()) << heard;
    heard += more;
    progress.clear();
    const std::size_t begin = heard.find("\r\n\r\n");
    const std::size_t end = heard.rfind("\n\n");
    if (begin == std::string::npos || end == std::string::npos || end <= begin) continue;
    for (const Event& event : events_in(heard.substr(begin + 4, end - begin - 2))) {
      if (event.name == "progress") progress.push_back(job_event_from_json(event.data));
    }
  }
  daemon_.client().cancel(job.id);
  for (std::size_t n = 1; n < progress.size(); ++n) {
    EXPECT_GE(progress[n].progress, progress[n - 1].progress);
    EXPECT_EQ(progress[n].state, JobState::kRunning);
  }
}

TEST_F(EventsTest, WhoComesBackGetsTheRest) {
  const Job job = finished_job(daemon_);
  const std::vector<Event> all = events_in(listen(job).body);
  ASSERT_GE(all.size(), 2U);
  const std::vector<Event> rest =
      events_in(listen(job, {{"Last-Event-ID", std::to_string(all[0].id)}}).body);
  ASSERT_EQ(rest.size(), all.size() - 1);
  EXPECT_EQ(rest[0].id, all[1].id);
  // A browser comes back after the end, too, and must be told not to.
  const Answer over = listen(job, {{"Last-Event-ID", std::to_string(all.back().id)}});
  EXPECT_EQ(over.status, 204);
  EXPECT_TRUE(over.body.empty());
}

// Whatever a client says that it has, it learns of the end.
TEST_F(EventsTest, TheEndIsToldInAnyCase) {
  const Job job = long_job(daemon_);
  const Connection connection(daemon_.url());
  connection.send(request("GET", "/v1/jobs/" + job.id + "/events", {},
                          {{"Last-Event-ID", "18446744073709551615"}}));
  std::string heard = connection.receive_some();
  EXPECT_THAT(heard, HasSubstr("200 OK"));
  daemon_.client().cancel(job.id);
  for (std::string more = heard; !more.empty(); heard += more) more = connection.receive_some();
  EXPECT_THAT(heard, HasSubstr("event: done"));
  const std::vector<Event> events = events_in(listen(job).body);
  EXPECT_EQ(events.back().name, "done");
  EXPECT_EQ(job_from_json(events.back().data).state, JobState::kCancelled);
}

// One stream for all jobs, so that a page needs one connection for them.
TEST_F(EventsTest, OfAllJobsComeInOneStream) {
  const Volume volume = upload(daemon_, sphere_upload());
  const Connection connection(daemon_.url());
  connection.send(request("GET", "/v1/events"));
  std::string heard = connection.receive_some();
  EXPECT_THAT(heard, HasSubstr("200 OK"));
  EXPECT_THAT(heard, HasSubstr("text/event-stream"));
  const Job first = submit(daemon_, volume, 100);
  const Job second = submit(daemon_, volume, 90);
  const auto told = [&heard](const Job& job) {
    return heard.find("event: done\ndata: {\"id\":\"" + job.id + "\",\"state\":\"succeeded\"") !=
           std::string::npos;
  };
  while (!told(first) || !told(second)) {
    const std::string more = connection.receive_some();
    ASSERT_FALSE(more.empty()) << heard;
    heard += more;
  }
  EXPECT_THAT(heard, HasSubstr("event: stage\ndata: {\"id\":\"" + second.id + "\""));
  EXPECT_TRUE(blames(daemon_.get("/v1/events?job=1"), "job"));
}

TEST_F(EventsTest, AreRefusedByName) {
  const Job job = finished_job(daemon_);
  EXPECT_TRUE(blames(listen(job, {{"Last-Event-ID", "x"}}), "Last-Event-ID"));
  EXPECT_TRUE(blames(daemon_.get("/v1/jobs/" + job.id + "/events?since=1"), "since"));
  EXPECT_TRUE(is_problem(daemon_.get("/v1/jobs/0123/events"), ErrorCode::kNotFound));
  EXPECT_EQ(daemon_.send("HEAD", "/v1/jobs/" + job.id + "/events").status, 200);
}

// --- Pages

TEST(Host, OfAnotherNameIsRefusedOnLoopback) {
  const Daemon daemon(std::vector<std::string>{"--allow-host", "viewer.local"});
  const auto status = [&](const std::string& host) {
    return answer_to(daemon.url(), "GET /v1/jobs HTTP/1.1\r\nHost: " + host + "\r\n\r\n").status;
  };
  EXPECT_EQ(status("localhost"), 200);
  EXPECT_EQ(status("127.0.0.1:8080"), 200);
  EXPECT_EQ(status("[::1]:8080"), 200);
  EXPECT_EQ(status("viewer.local:8080"), 200);
  EXPECT_EQ(status("evil.example"), 403);
  EXPECT_TRUE(
      is_problem(answer_to(daemon.url(), "GET /livez HTTP/1.1\r\nHost: evil.example:8080\r\n\r\n"),
                 ErrorCode::kForbidden));
}

TEST(Origin, APageFromElsewhereChangesNothing) {
  const Daemon daemon;
  const RawUpload sphere = sphere_upload();
  const std::string target = "/v1/volumes?" + sphere.query;
  EXPECT_TRUE(
      is_problem(daemon.send("POST", target, sphere.bytes, {{"Origin", "https://evil.example"}}),
                 ErrorCode::kForbidden));
  EXPECT_TRUE(daemon.client().volumes().empty());
  EXPECT_EQ(daemon.send("POST", target, sphere.bytes, {{"Origin", "http://localhost"}}).status,
            201);
  const Answer read = daemon.get("/v1/volumes", {{"Origin", "https://evil.example"}});
  EXPECT_EQ(read.header("access-control-allow-origin"), "");
  EXPECT_TRUE(is_problem(
      daemon.send("OPTIONS", "/v1/jobs", {},
                  {{"Origin", "https://evil.example"}, {"Access-Control-Request-Method", "POST"}}),
      ErrorCode::kMethodNotAllowed));
}

TEST(Cors, AConfiguredPageMayDoAll) {
  const std::string page = "https://viewer.example";
  const Daemon daemon(std::vector<std::string>{"--cors-origin", page + ",https://b.example"});
  const Headers origin = {{"Origin", page}};
  const Answer preflight = daemon.send("OPTIONS", "/v1/jobs", {},
                                       {{"Origin", page},
                                        {"Access-Control-Request-Method", "POST"},
                                        {"Access-Control-Request-Headers", "idempotency-key"}});
  EXPECT_EQ(preflight.status, 204);
  EXPECT_EQ(preflight.header("access-control-allow-origin"), page);
  EXPECT_EQ(preflight.header("access-control-allow-methods"), "GET, HEAD, POST");
  EXPECT_THAT(preflight.header("access-control-allow-headers"), HasSubstr("Idempotency-Key"));
  const RawUpload sphere = sphere_upload();
  const Answer made = daemon.send("POST", "/v1/volumes?" + sphere.query, sphere.bytes, origin);
  EXPECT_EQ(made.status, 201);
  EXPECT_EQ(made.header("access-control-allow-origin"), page);
  EXPECT_EQ(made.header("vary"), "Origin");
  for (const char* name : {"Location", "Isomesh-Notes", "Link"}) {
    EXPECT_THAT(made.header("access-control-expose-headers"), HasSubstr(name));
  }
  // The page may read error responses too.
  EXPECT_EQ(daemon.get("/v1/jobs/0123", origin).header("access-control-allow-origin"), page);
  EXPECT_EQ(daemon.get("/livez").header("access-control-allow-origin"), "");
}

}  // namespace
}  // namespace isomesh
