#include "client/isomesh/client.h"

#include <atomic>
#include <cstdlib>
#include <future>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "proto/json.h"
#include "tests/unit/client/support.h"

namespace isomesh {
namespace {

using test::answer_with;
using test::error_of;
using test::FakeServer;
using test::finished_job;
using test::some_volume;
using test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;

constexpr const char* kJson = "application/json";

TEST(Refusals, KeepTheServersCodeReasonAndFields) {
  const std::vector<Error> refusals = {
      invalid_parameter("passes", "must be a whole number from 0 to 1000"),
      Error(ErrorCode::kNotFound, "there is no such volume"),
      Error(ErrorCode::kUnusableVolume, "slice 41 of 93 is missing"),
      Error(ErrorCode::kTooManyRequests, "the queue is full")};
  for (const Error& refused : refusals) {
    FakeServer server;
    server.http.Post("/v1/jobs", [&](const httplib::Request&, httplib::Response& response) {
      answer_with(response, refused);
    });
    Client client({.server = server.start(), .retry_timeout = {}});
    const Error error = error_of([&] { client.submit({}); });
    EXPECT_EQ(error.code(), refused.code());
    EXPECT_STREQ(error.what(), refused.what());
    EXPECT_EQ(error.fields(), refused.fields());
  }
}

TEST(Refusals, OfSomethingInFrontOfTheServerAreToldByTheirStatus) {
  const std::vector<std::pair<int, ErrorCode>> expectations = {
      {413, ErrorCode::kTooLarge},    {401, ErrorCode::kUnauthorized},
      {403, ErrorCode::kForbidden},   {404, ErrorCode::kNotFound},
      {502, ErrorCode::kUnreachable}, {503, ErrorCode::kUnavailable},
      {504, ErrorCode::kUnreachable}, {507, ErrorCode::kOutOfSpace},
      {302, ErrorCode::kInternal},    {500, ErrorCode::kInternal}};
  for (const auto& [status, code] : expectations) {
    FakeServer server;
    server.http.Get("/v1/volumes",
                    [&, answer = status](const httplib::Request&, httplib::Response& response) {
                      response.set_content("<html>no</html>", "text/html");
                      response.status = answer;
                    });
    Client client({.server = server.start(), .retry_timeout = {}});
    const Error error = error_of([&] { client.volumes(); });
    EXPECT_EQ(error.code(), code) << status;
    EXPECT_THAT(error.what(), HasSubstr(std::to_string(status)));
  }
}

TEST(Reachability, AServerThatIsNotThereIsReportedAtOnce) {
  Client client({.server = test::unused_url()});
  const auto start = std::chrono::steady_clock::now();
  EXPECT_EQ(error_of([&] { client.job("1"); }).code(), ErrorCode::kUnreachable);
  EXPECT_EQ(error_of([&] { client.submit({}); }).code(), ErrorCode::kUnreachable);
  EXPECT_LT(std::chrono::steady_clock::now() - start, ClientOptions{}.connect_timeout);
}

TEST(Reachability, AGetWhoseConnectionBrokeIsTriedAgain) {
  std::atomic<int> requests = 0;
  const std::string body = to_json(std::vector<Volume>{some_volume()});
  test::SocketServer server([&](int socket) {
    test::read_head(socket);
    if (++requests == 3) test::answer(socket, "200 OK", body);
  });
  Client client({.server = server.url()});
  EXPECT_THAT(client.volumes(), ElementsAre(some_volume()));
  EXPECT_EQ(server.connections(), 3);
}

TEST(Reachability, TriesEndAndChangesAreNotRepeated) {
  test::SocketServer server([](int socket) { test::read_head(socket); });
  Client client({.server = server.url()});
  EXPECT_EQ(error_of([&] { client.job("1"); }).code(), ErrorCode::kUnreachable);
  EXPECT_EQ(server.connections(), 4);
  EXPECT_EQ(error_of([&] { client.cancel("1"); }).code(), ErrorCode::kUnreachable);
  EXPECT_EQ(server.connections(), 5);
}

// The key makes it one job, however often it is sent.
TEST(Reachability, ASubmissionIsRepeatedWithItsKey) {
  std::vector<std::string> keys;
  test::SocketServer server([&](int socket) {
    const std::string head = test::read_head(socket);
    const std::string name = "Idempotency-Key: ";
    const std::size_t begin = head.find(name) + name.size();
    keys.push_back(head.substr(begin, head.find("\r\n", begin) - begin));
  });
  Client client({.server = server.url()});
  EXPECT_EQ(error_of([&] { client.submit({}); }).code(), ErrorCode::kUnreachable);
  ASSERT_EQ(keys.size(), 4U);
  EXPECT_GE(keys[0].size(), 16U);
  EXPECT_THAT(keys, testing::Each(keys[0]));
  EXPECT_EQ(error_of([&] { client.submit({}); }).code(), ErrorCode::kUnreachable);
  EXPECT_NE(keys[4], keys[0]);
  EXPECT_EQ(error_of([&] { client.submit({}, "mine"); }).code(), ErrorCode::kUnreachable);
  EXPECT_EQ(keys[8], "mine");
}

// Volumes and the token go to the server that was named, and to nothing else.
TEST(Reachability, ProxiesOfTheEnvironmentAreNotUsed) {
  FakeServer server;
  server.http.Get("/v1/volumes", test::answering(to_json(std::vector{some_volume()})));
  Client client({.server = server.start()});
  ASSERT_EQ(::setenv("http_proxy", test::unused_url().c_str(), 1), 0);
  ASSERT_EQ(::setenv("all_proxy", test::unused_url().c_str(), 1), 0);
  EXPECT_NO_THROW(EXPECT_THAT(client.volumes(), ElementsAre(some_volume())));
  ::unsetenv("http_proxy");
  ::unsetenv("all_proxy");
}

TEST(Reachability, IsAskedFromSeveralThreads) {
  FakeServer server;
  server.http.Get("/v1/volumes", test::answering(to_json(std::vector{some_volume()})));
  Client client({.server = server.start()});
  std::vector<std::jthread> threads;
  for (int n = 0; n < 8; ++n) {
    threads.emplace_back([&] {
      for (int turn = 0; turn < 20; ++turn) EXPECT_EQ(client.volumes().size(), 1U);
    });
  }
}

TEST(Urls, IdentifiersCannotLeaveTheirPlace) {
  FakeServer server;
  std::vector<std::string> targets;
  server.http.set_pre_routing_handler(
      [&](const httplib::Request& request, httplib::Response& response) {
        targets.push_back(request.target);
        response.set_content(to_json(some_volume()), kJson);
        return httplib::Server::HandlerResponse::Handled;
      });
  Client client({.server = server.start()});
  client.volume("..jobs?a=b#c d%\r\nX: y");
  EXPECT_THAT(targets, ElementsAre("/v1/volumes/..jobs%3Fa%3Db%23c%20d%25%0D%0AX%3A%20y"));
  for (const char* id : {"", ".", "..", "../jobs", "1/histogram"}) {
    EXPECT_EQ(error_of([&] { client.volume(id); }).code(), ErrorCode::kInvalidParameter) << id;
  }
  EXPECT_EQ(targets.size(), 1U);
}

TEST(Urls, ATokenCannotAddHeaders) {
  EXPECT_EQ(error_of([] { Client({.token = "a\r\nX: y"}); }).code(), ErrorCode::kInvalidParameter);
}

TEST(Urls, AKeyCannotAddHeaders) {
  FakeServer server;
  Client client({.server = server.start()});
  EXPECT_EQ(error_of([&] { client.submit({}, "a\r\nX: y"); }).code(), ErrorCode::kInvalidParameter);
}

TEST(Volumes, AreAskedForPageByPage) {
  FakeServer server;
  server.http.Get("/v1/volumes", [&](const httplib::Request& request, httplib::Response& response) {
    const bool is_first = !request.has_param("cursor");
    EXPECT_EQ(request.get_param_value("cursor"), is_first ? "" : "a&b");
    response.set_content(to_json(std::vector{some_volume()}, is_first ? "a&b" : ""), kJson);
  });
  Client client({.server = server.start()});
  EXPECT_EQ(client.volumes().size(), 2U);
}

TEST(Volumes, AreLookedAtBeforeAJob) {
  TemporaryFolder folder;
  FakeServer server;
  httplib::Params asked;
  server.http.set_pre_routing_handler([&](const httplib::Request& request, const auto&) {
    asked = request.params;
    return httplib::Server::HandlerResponse::Unhandled;
  });
  server.http.Get("/v1/volumes/7/histogram",
                  test::answering(to_json(Histogram{"7", {0, 9}, {1, 2}})));
  server.http.Get("/v1/volumes/7/slice.png", test::answering("a picture", "image/png"));
  Estimate estimate;
  estimate.triangles = 11;
  server.http.Get("/v1/estimate", test::answering(to_json(estimate)));
  Client client({.server = server.start()});
  const auto value = [&](const std::string& name) {
    const auto found = asked.find(name);
    return found == asked.end() ? "none" : found->second;
  };

  EXPECT_EQ(client.histogram("7", 2).counts, (std::vector<std::uint64_t>{1, 2}));
  EXPECT_EQ(value("bins"), "2");
  client.slice("7", {.axis = "x", .index = 3, .window = std::array{-160.0, 240.5}},
               folder / "slice.png");
  EXPECT_EQ(test::read_file(folder / "slice.png"), "a picture");
  EXPECT_EQ(value("axis") + ' ' + value("index") + ' ' + value("window"), "x 3 -160,240.5");
  JobParameters parameters;
  parameters.volume = "7";
  parameters.iso = 60;
  parameters.formats = {MeshFormat::kDrc, MeshFormat::kStl};
  parameters.draco.speed = 3;
  parameters.components.keep = 2;
  EXPECT_EQ(client.estimate(parameters).triangles, 11U);
  parameters.lambda = default_lambda(parameters);  // what a request that names none means
  EXPECT_EQ(parse_job_parameters({asked.begin(), asked.end()}, VolumeIn::kQuery), parameters);
}

TEST(Follow, TellsEventsAndComesBackWhereItWas) {
  FakeServer server;
  std::vector<std::string> last_ids;
  const std::string stage =
      "id: 4\nevent: stage\ndata: " + to_json(JobEvent{JobState::kRunning, Stage::kLoad, 0.5}) +
      "\n\n";
  server.http.Get(
      "/v1/jobs/7/events", [&](const httplib::Request& request, httplib::Response& response) {
        last_ids.push_back(request.get_header_value("Last-Event-ID"));
        if (last_ids.size() == 1) {
          // Less comes than was announced: the connection has broken.
          response.set_content_provider(
              1000, "text/event-stream", [&](std::size_t, std::size_t, httplib::DataSink& sink) {
                const std::string begin = "retry: 1\n\n: hello\n\n" + stage + "id: 5\nev";
                sink.write(begin.data(), begin.size());
                return false;
              });
        } else {
          response.set_content(
              "id: 6\nevent: done\ndata: " + to_json(finished_job("7", "mesh")) + "\n\n",
              "text/event-stream");
        }
      });
  Client client({.server = server.start()});
  std::vector<JobEvent> seen;
  const Job job = client.follow("7", [&](const JobEvent& event) { seen.push_back(event); });
  EXPECT_EQ(job.id, "7");
  EXPECT_THAT(last_ids, ElementsAre("", "4"));
  EXPECT_THAT(seen, ElementsAre(JobEvent{JobState::kRunning, Stage::kLoad, 0.5}));
}

TEST(Wait, LooksUntilTheJobIsDoneAndShowsEveryStep) {
  FakeServer server;
  std::atomic<int> looks = 0;
  server.http.Get("/v1/jobs/7", [&](const httplib::Request& request, httplib::Response& response) {
    EXPECT_EQ(request.get_param_value("wait"), "1");
    Job job = finished_job("7", "mesh");
    if (++looks < 3) {
      job.state = JobState::kRunning;
      job.mesh.reset();
    }
    response.set_content(to_json(job), kJson);
  });
  Client client({.server = server.start()});
  std::vector<JobState> states;
  const Job job = client.wait("7", [&](const Job& seen) { states.push_back(seen.state); });
  EXPECT_EQ(job.state, JobState::kSucceeded);
  EXPECT_THAT(states, ElementsAre(JobState::kRunning, JobState::kRunning, JobState::kSucceeded));
}

// The server answers only when the client has gone.
TEST(Wait, EndsAtOnceWhenAskedToStop) {
  std::stop_source stop;
  test::SocketServer server([&](int socket) {
    test::read_head(socket);
    stop.request_stop();
    test::read_to_the_end(socket);
  });
  Client client({.server = server.url(), .stop = stop.get_token()});
  EXPECT_EQ(error_of([&] { client.wait("7"); }).code(), ErrorCode::kCancelled);
  // Nothing is sent after that.
  EXPECT_EQ(error_of([&] { client.job("7"); }).code(), ErrorCode::kCancelled);
  EXPECT_EQ(server.connections(), 1);
}

TEST(Timeouts, ASilentServerIsGivenUp) {
  test::SocketServer server([](int socket) { test::read_to_the_end(socket); });
  Client client({.server = server.url(), .silence_timeout = std::chrono::milliseconds{100}});
  const Error error = error_of([&] { client.cancel("7"); });
  EXPECT_EQ(error.code(), ErrorCode::kUnreachable);
  EXPECT_THAT(error.what(), HasSubstr("did not respond in time"));
}

TEST(Timeouts, TheLongestDoesNotEndALongPoll) {
  FakeServer server;
  server.http.Get("/v1/jobs/7", test::answering(to_json(finished_job("7", "mesh"))));
  Client client({.server = server.start(), .silence_timeout = std::chrono::milliseconds::max()});
  EXPECT_EQ(client.job("7", std::chrono::seconds{30}).state, JobState::kSucceeded);
}

class CancelledUpload : public testing::Test {
 protected:
  CancelledUpload() {
    server_.http.Post("/v1/volumes", [](const httplib::Request&, httplib::Response& response) {
      response.status = 201;
      response.set_header("Location", "/v1/uploads/7");
    });
    // The response comes only after the client has cancelled the upload.
    server_.http.Patch("/v1/uploads/7", [this](const httplib::Request&, httplib::Response&) {
      stop_.request_stop();
      cancelled_.get_future().wait_for(test::kLongest);
    });
  }

  void answer_to_delete(int status, const std::string& body) {
    server_.http.Delete("/v1/uploads/7",
                        [=, this](const httplib::Request&, httplib::Response& response) {
                          response.status = status;
                          if (!body.empty()) response.set_content(body, kJson);
                          cancelled_.set_value();
                        });
  }

  Error error() {
    TemporaryFolder folder;
    test::write_file(folder / "small", "abc");
    Client client({.server = server_.start(), .stop = stop_.get_token()});
    UploadOptions options;
    options.resumable_bytes = 1;
    return error_of([&] { client.upload(folder / "small", options); });
  }

  std::stop_source stop_;
  std::promise<void> cancelled_;
  FakeServer server_;
};

TEST_F(CancelledUpload, IsToldToTheServerAfterAStopRequestToo) {
  answer_to_delete(204, {});
  const Error told = error();
  EXPECT_EQ(told.code(), ErrorCode::kCancelled);
  EXPECT_STREQ(told.what(), "interrupted");
}

TEST_F(CancelledUpload, NamesTheVolumeThatWasStoredBefore) {
  const Volume volume = some_volume();
  answer_to_delete(200, to_json(std::vector<Volume>{volume}));
  const Error told = error();
  EXPECT_EQ(told.code(), ErrorCode::kCancelled);
  EXPECT_EQ(told.what(), "interrupted; it was too late to cancel the volume " + volume.id);
}

// In the middle of an answer.
TEST(Timeouts, AServerThatFallsSilentIsGivenUp) {
  test::SocketServer server([](int socket) {
    test::read_head(socket);
    test::send_text(socket, "HTTP/1.1 200 OK\r\nContent-Length: 9\r\n\r\n[");
    test::read_to_the_end(socket);
  });
  Client client({.server = server.url(), .silence_timeout = std::chrono::milliseconds{100}});
  EXPECT_THAT(error_of([&] { client.volumes(); }).what(), HasSubstr("did not respond in time"));
}

TEST(Timeouts, AServerThatNoLongerReadsIsGivenUp) {
  std::promise<void> over;
  test::SocketServer server([&](int socket) {
    test::read_head(socket);
    test::send_text(socket, "HTTP/1.1 100 Continue\r\n\r\n");
    over.get_future().wait();
  });
  TemporaryFolder folder;
  test::write_file(folder / "large", test::pattern(20'000'000));
  Client client({.server = server.url(), .silence_timeout = std::chrono::milliseconds{100}});
  EXPECT_THAT(error_of([&] { client.upload(folder / "large"); }).what(),
              HasSubstr("did not respond in time"));
  over.set_value();
}

}  // namespace
}  // namespace isomesh
